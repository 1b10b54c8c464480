"""The weakly compressible method: pressure from an equation of state, everything explicit."""

import logging
from math import inf
from typing import ClassVar

import numpy as np
from pydantic import Field as Parameter

from spume import kernels
from spume.domain import Domain
from spume.lattice import corner_neighbours
from spume.pairs import pair_sum, pair_term, row_map, row_term
from spume.particles import ANY, FLUID, WALL, Field
from spume.schemes.collision.base import Collision
from spume.schemes.collision.inelastic import Inelastic
from spume.schemes.gradient.base import Gradient
from spume.schemes.gradient.corrected import Corrected
from spume.schemes.gradient.sum import Sum
from spume.schemes.shifting.base import Shifting
from spume.schemes.shifting.none import Unshifted
from spume.schemes.source.base import DIVERGENCE
from spume.steps.base import Step, accelerate, accelerated, corrected, moved, not_negative

log = logging.getLogger("spume")


@row_term(reads=("relative_density", "density", "speed_of_sound"))
def tait(a, exponent):  # type: ignore[no-untyped-def]
    stiffness = a.density * a.speed_of_sound * a.speed_of_sound / exponent
    return stiffness * (a.relative_density**exponent - 1.0)


def _scaled(a, total, scale):  # type: ignore[no-untyped-def]
    return scale * total / (a.density * a.speed_of_sound)


@pair_term(reads=("pressure", "linear_gradient", "density", "speed_of_sound"), finish=_scaled)
def smoothing(a, b, r, w, scale):  # type: ignore[no-untyped-def]
    # Without the mean gradient the weight of the water itself would drive density through the surface.
    linear = 0.5 * (a.linear_gradient + b.linear_gradient).dot(r)
    return (b.pressure - a.pressure - linear) * w / r.dot(r)


@row_term(reads=("relative_density", "divergence", "density_diffusion", "fluid_neighbours", "kind"))
def continuity(a, dt, few, enough):  # type: ignore[no-untyped-def]
    diffusion = kernels.qd.select(a.kind == FLUID, a.density_diffusion, 0.0)
    change = dt * (diffusion - a.relative_density * a.divergence)
    # Drops have the pressure of the air: nothing would ever take back what their few neighbours add up to.
    share = min(max((a.fluid_neighbours - few) / (enough - few), 0.0), 1.0)
    share = kernels.qd.select(a.kind == FLUID, share, 1.0)
    return 1.0 + share * (a.relative_density + change - 1.0)


_SPRAY = (0.4, 0.7)
"""Parts of the neighbours in a tank's corner: with less than the first a row is spray, from the second on not [1]."""


class WeaklyCompressible(Step, name="weakly-compressible"):
    """P = rho c0^2/gamma [(rho'/rho)^gamma - 1], no linear system (after Shakibaeinia & Jin 2010).

    With the relative density s = rho'/rho of a row: P^k by Tait's equation; u^(k+1) = u^k + dt (a - grad P^k/rho);
    Ds/Dt = -s div u^(k+1) + delta l0 c0 2 d/n0 sum_j psi_ij W/r^2 / (rho c0^2),
    psi_ij = P_j - P_i - (grad P_i + grad P_j) . r_ij/2 with the corrected gradient over the fluid (Antuono 2010:
    diffusion that leaves linear pressures alone, on any arrangement);
    r += dt u^(k+1), the symplectic Euler scheme, stable for waves of sound up to a Courant number of about one.
    Shakibaeinia & Jin take s = n/n0 of the positions, whose disorder is then pressure; here s follows from continuity.
    Spray, rows with hardly a fluid neighbour, has s = 1. Across an interface of fluids pressures are taken as they are,
    where steps that solve for them see what is continuous there. Walls: the pressure of solid rows is extrapolated
    from the fluid; what comes near them is stopped by collisions, for this pressure answers late. Density errors are
    of the order of the Mach number squared, |u|^2/c0^2. With the gradient ``sum`` momentum is conserved. For violent
    flows without long rest, and where a linear system is unwanted; steps are shorter by the Mach number than those of
    a projection.
    """

    ids: ClassVar = ("A5",)
    reference: ClassVar = ("shakibaeinia2010", "antuono2010")
    fields: ClassVar = (
        *Step.fields,
        DIVERGENCE,
        Field("relative_density", (), "1", "density over that of the material at rest", initial=1.0, output=True,
              restart=True),
        Field("density_diffusion", (), "1/s", "rate of the relative density by diffusion"),
        Field("linear_gradient", ("d",), "Pa/m", "gradient of the pressure, exact for linear ones"),
        Field("speed_of_sound", (), "m/s", "speed of sound, the same for all rows", restart=True),
    )  # fmt: skip

    gradient: Gradient = Sum()
    """Gradient of the pressure."""
    collision: Collision = Inelastic(distance=0.7)
    """Treatment of particles that come too close."""
    shifting: Shifting = Unshifted()
    """Particle shifting."""
    speed_of_sound: float | None = Parameter(default=None, gt=0.0)
    """Speed of sound c0 [m/s]; default: ten times the larger of sqrt(|g| H) and the largest initial speed."""
    exponent: float = Parameter(default=7.0, ge=1.0)
    """Exponent gamma of the equation of state [1]."""
    diffusion: float = Parameter(default=0.1, ge=0.0, le=1.0)
    """Coefficient delta of the diffusion of density [1]."""
    acoustic_courant: float = Parameter(default=0.25, gt=0.0, le=1.0)
    """Courant number of sound: dt <= acoustic_courant l0/(c0 + |u|) [1]."""

    def begin(self, domain: Domain) -> None:
        """Choose the speed of sound and give rows the density of their initial pressure."""
        super().begin(domain)
        particles = domain.particles
        c0 = self.speed_of_sound if self.speed_of_sound is not None else self._ten_times_the_flow(domain)
        log.info("speed of sound %.4g m/s", c0)
        stiffness = particles.numpy("density") * c0**2 / self.exponent
        ratio = np.maximum(1.0 + particles.numpy("pressure") / np.maximum(stiffness, 1e-30), 1e-6)
        particles.set("speed_of_sound", np.full(particles.count, c0))
        particles.set("relative_density", ratio ** (1.0 / self.exponent))

    def _ten_times_the_flow(self, domain: Domain) -> float:
        """Return 10 max(sqrt(|g| H), |u|) [m/s], H the extent of the fluid along gravity."""
        particles = domain.particles
        fluid = particles.numpy("kind") == FLUID
        g = np.asarray(domain.gravity.at(0.0), dtype=float)
        strength = float(np.linalg.norm(g))
        height = float(np.ptp(particles.numpy("position")[fluid] @ g)) / strength if strength > 0.0 else 0.0
        fastest = max(
            float(np.sqrt(strength * (height + domain.lattice.spacing))), particles.largest_norm("velocity", ANY)
        )
        if fastest == 0.0:
            raise ValueError("step weakly-compressible: without gravity and speed, speed_of_sound [m/s] must be given")
        return 10.0 * fastest

    def max_dt(self, domain: Domain, speed: float) -> float:
        """Return acoustic_courant l0/(c0 + |u|) [s]."""
        c0 = domain.particles.smallest("speed_of_sound", FLUID)
        # Without a fluid row there is no sound.
        return self.acoustic_courant * domain.lattice.spacing / (c0 + speed) if c0 > 0.0 else inf

    def __call__(self, domain: Domain, t: float, dt: float, before: float) -> dict[str, float]:
        """Advance the domain from t to t + dt: forces, pressure, velocity, density, position."""
        lattice, particles, pairs, bodies = domain.lattice, domain.particles, domain.pairs, domain.bodies
        # Where walls do not extrapolate, wall rows have a density of their own.
        rows = FLUID if self.wall_model.mirror else FLUID | WALL
        for body in bodies:
            body.prescribe(particles, t, dt)

        with domain.stages("search"):
            removed = pairs.update(particles)
        with domain.stages("forces"):
            self.number_density(lattice, particles, pairs)
            self.wall_model.count_fluid(lattice, particles, pairs)
            self.free_surface(lattice, particles, pairs, self.number_density)
            accelerate(domain, t, dt)
            self.wall_model.show_slip(lattice, particles, pairs)
            self.viscosity(lattice, particles, pairs, dt)
            for body in bodies:
                body.force(particles, pairs, dt)
            row_map(accelerated, particles, out="velocity", rows=self.wall_model.predicted, arguments=(dt,))
            acceleration = particles.largest_norm("acceleration")

        with domain.stages("pressure"):
            row_map(tait, particles, out="pressure", rows=rows, arguments=(self.exponent,))
            if not self.negative_pressure:
                row_map(not_negative, particles, out="pressure", rows=rows)
            self.wall_model.neumann(particles, dt)
            self.wall_model.extrapolate(lattice, particles, pairs)
            self.gradient(lattice, particles, pairs, over=self.wall_model.carriers, dt=dt, moved=False)
            row_map(corrected, particles, out="velocity", rows=FLUID, arguments=(dt,))
            self.wall_model.rest(particles)
        with domain.stages("density"):
            model = self.number_density
            if self.diffusion > 0.0:
                Corrected()(lattice, particles, pairs, out="linear_gradient", over=FLUID)
                pair_sum(
                    smoothing, particles, pairs, out="density_diffusion", weight=model.weight,
                    re=model.radius(lattice), over=FLUID,
                    arguments=(self.diffusion * lattice.spacing * 2.0 * lattice.dimension / model.n0(lattice),),
                )  # fmt: skip
            self.divergence(lattice, particles, pairs, out="divergence", mirror=self.wall_model.mirror)
            corner = corner_neighbours(self.wall_model.re, lattice.dimension)
            few, enough = (part * corner for part in _SPRAY)
            row_map(continuity, particles, out="relative_density", rows=rows, arguments=(dt, few, enough))
        row_map(moved, particles, out="position", rows=FLUID, arguments=(dt,))
        for body in bodies:
            body.move(particles, t + dt)

        with domain.stages("tidying"):
            self.collision(lattice, particles, pairs, dt)
            self.shifting(lattice, particles, pairs, self.number_density, dt)
        for body in bodies:
            body.respond(particles, t, dt)
        c0 = particles.smallest("speed_of_sound", FLUID)
        mach = particles.largest_norm("velocity", FLUID) / c0 if c0 > 0.0 else 0.0
        return {"removed": removed, "mach": mach, "acceleration": acceleration}
