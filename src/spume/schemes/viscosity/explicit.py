"""Explicit viscosity with the Laplacian model."""

from collections.abc import Callable
from math import inf
from typing import Any, ClassVar, Self

from pydantic import model_validator

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, PairSum, PairTerm, pair_sums, pair_term
from spume.particles import FLUID, Particles
from spume.schemes.laplacian.base import Laplacian, Terms
from spume.schemes.laplacian.original import Original
from spume.schemes.turbulence.base import Turbulence
from spume.schemes.turbulence.none import Laminar
from spume.schemes.viscosity.base import Viscosity, refuse_lagged, shared_viscosity
from spume.schemes.wall_function.base import WallFunction
from spume.schemes.wall_function.none import Resolved

NEAREST = 0.5
"""Pairs nearer than this exchange less momentum than at this distance [l0]."""


def _added(a, total, scale, nearest):  # type: ignore[no-untyped-def]
    return a.acceleration + scale / a.density * total


class Explicit(Viscosity, name="explicit"):
    """1/rho div(mu grad u)_i = 1/rho_i s sum_j mu_ij c_ij (u_j - u_i), at the start of the step.

    c and s are those of the Laplacian model, mu_ij is the harmonic mean of rho nu of the pair. Momentum is conserved to
    round-off with a symmetric Laplacian. Solid rows take part with their ``slip_velocity``, the image of the fluid in
    the wall, or with the stress of a ``wall_function``: mu (u_j - u_i) is then -tau h t, t the direction of the motion
    along the wall and h the distance of i from the plane through j, so that per area the fluid loses tau. Stable up to
    a time step of the order of l0^2/nu; for more, ``implicit``. Between rows nearer than l0/2, which are about to
    collide, c is less by (r/(l0/2))^4: growing like 1/r^3, it would turn such a pair round and throw it apart.
    """

    ids: ClassVar = ("A6",)
    reference: ClassVar = "koshizuka1996"
    conserves: ClassVar = frozenset({"momentum"})

    laplacian: Laplacian = Original()
    """Laplacian model."""
    turbulence: Turbulence = Laminar()
    """Turbulence model, which adds to the viscosity."""
    wall_function: WallFunction = Resolved()
    """Stress of no-slip walls whose boundary layer the particles do not resolve."""

    @model_validator(mode="after")
    def _of_one_instant(self) -> Self:
        refuse_lagged(self.laplacian)
        return self

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, dt: float) -> None:
        """Add div(mu grad u)/rho to ``acceleration`` [m/s^2]; neighbours take part with ``slip_velocity``."""
        viscosity = self.turbulence(lattice, particles, pairs)
        self.laplacian.prepare(lattice, particles, pairs)
        pair_sums((self._sum(lattice, viscosity),), particles, pairs)

    def sums(self, lattice: Lattice) -> tuple[PairSum, ...]:
        """Return those of the turbulence model."""
        return self.turbulence.sums(lattice)

    def as_sums(self, lattice: Lattice) -> tuple[PairSum, ...]:
        """Return its one sum, where neither turbulence nor Laplacian have to be made ready for it."""
        ready = self.turbulence.given and type(self.laplacian).prepare is Laplacian.prepare
        return (self._sum(lattice, self.turbulence.given),) if ready else ()

    def _sum(self, lattice: Lattice, viscosity: str) -> PairSum:
        model = self.laplacian
        stress = None if self.wall_function.resolved else self.wall_function.function()
        return PairSum(
            (_term(model.terms(), stress),), ("acceleration",), model.weight, model.radius(lattice),
            arguments=(model.scale(lattice), NEAREST * lattice.spacing), fields=(("viscosity", viscosity),),
        )  # fmt: skip

    def largest(self, particles: Particles, material: float) -> float:
        """Return the largest kinematic viscosity [m^2/s], of the turbulence in the step before too."""
        return max(material, self.turbulence.largest(particles))

    def max_dt(self, lattice: Lattice, viscosity: float) -> float:
        """Return l0^2/(4 d nu) [s], with the default radii less than half the limit of stability on the lattice.

        The limit is 2/(nu k), k the largest eigenvalue of the Laplacian. This is 0.34 of it in 2D and 0.25 in 3D with
        ``distance``, 0.24 and 0.17 with ``original``, 0.23 and 0.17 with ``higher-order``, whose published form has
        the most, 0.49 in 2D; 0.13 and 0.08 with ``second-order``.
        """
        return lattice.spacing**2 / (4 * lattice.dimension * viscosity) if viscosity > 0 else inf


@kernels.func
def softened(r, nearest):  # type: ignore[no-untyped-def]
    """Return (r/nearest)^4, 1 where that is more."""
    q = min(r.dot(r) / (nearest * nearest), 1.0)
    return q * q


@kernels.cached
def _term(terms: Terms, stress: Callable[..., Any] | None) -> PairTerm:
    """Return the pair term of a Laplacian model; the same object each time, so that it compiles once."""
    coefficient = terms.coefficient
    fields = ("slip_velocity", "viscosity", "density", "kind", "acceleration", *terms.reads)

    @pair_term(reads=fields, shape=("d",), finish=_added)
    def diffusion(a, b, r, w, scale, nearest):  # type: ignore[no-untyped-def]
        mu = shared_viscosity(a, b) * softened(r, nearest)
        return mu * coefficient(a, b, r, w) * (b.slip_velocity - a.slip_velocity)

    if stress is None:
        return diffusion

    @pair_term(
        reads=(*fields, "kinematic_viscosity", "to_surface", "wall_velocity", "slip"), shape=("d",), finish=_added
    )
    def diffusion_with_wall_stress(a, b, r, w, scale, nearest):  # type: ignore[no-untyped-def]
        flux = shared_viscosity(a, b) * softened(r, nearest) * (b.slip_velocity - a.slip_velocity)
        if b.kind != FLUID:
            flux = a.slip_velocity * 0.0
            depth = b.to_surface.norm()
            normal = b.to_surface / max(depth, 1e-30)
            apart = -r.dot(normal)
            along = a.slip_velocity - b.wall_velocity
            along -= along.dot(normal) * normal
            speed = along.norm()
            # A solid row stands for the wall that it belongs to where that lies between both.
            if b.slip == 0 and apart > depth and speed > 0.0:
                distance = max(apart - depth, 0.25 * depth)
                flux = -a.density * stress(speed, distance, a.kinematic_viscosity) * apart / speed * along
        return coefficient(a, b, r, w) * flux

    return diffusion_with_wall_stress
