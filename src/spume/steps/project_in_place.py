"""Projection at the positions where the step starts: waves, sloshing, and the default."""

from typing import ClassVar, Literal, Self

from pydantic import model_validator

from spume.domain import Domain
from spume.pairs import RowMap, row_map, row_maps
from spume.schemes.air.base import Air
from spume.schemes.air.none import Nowhere
from spume.schemes.correction import SECOND_MOMENT, WALL_MOMENT
from spume.schemes.divergence.base import Divergence
from spume.schemes.divergence.bounded import Bounded
from spume.schemes.free_surface.base import SURFACE_SHARE, FreeSurface
from spume.schemes.free_surface.imaged import Imaged as ImagedSurface
from spume.schemes.gradient.base import Gradient
from spume.schemes.gradient.imaged import Imaged
from spume.schemes.laplacian.base import Laplacian
from spume.schemes.laplacian.corrected_vector import CorrectedVector
from spume.schemes.laplacian.distance import Distance
from spume.schemes.number_density.base import NumberDensity
from spume.schemes.number_density.base import Original as OriginalNumberDensity
from spume.schemes.shifting.base import Shifting
from spume.schemes.shifting.fickian_along_surface import FickianAlongSurface
from spume.schemes.source.base import Source
from spume.schemes.source.divergence_density import DivergenceDensity
from spume.schemes.velocity_gradient import VELOCITY_GRADIENT, keep_volume
from spume.schemes.viscosity.base import Viscosity
from spume.schemes.viscosity.explicit import Explicit
from spume.schemes.weight.isochoric import Isochoric
from spume.steps.base import (
    Projection,
    accelerate,
    accelerated,
    corrected,
    moved,
    solve_pressure,
    sum_at_start,
    surface_pressure,
)


class ProjectInPlace(Projection, name="project-in-place"):
    """u += tau a with the forces and the pressure at r^k, then r += dt u^(k+1).

    All sums are taken at the positions of the start. The velocity with which rows move over a step is that of its
    middle, so forces act from the middle of the step before to the middle of this one: tau = (dt_before + dt)/2,
    and dt/2 in the first step, which starts from the velocity at its start (leapfrog).
    With tau = dt there everything would happen half a step early. The amplitude of an oscillation neither decays nor
    grows, where r += dt (u^k + u^(k+1))/2 with the same pressure would gain pi^2 dt/T a period and a pressure at
    moved positions would lose 2 pi^2 dt/T.
    """

    ids: ClassVar = ("A1",)
    reference: ClassVar = "cummins1999"
    instants: ClassVar = ("k",)
    fields: ClassVar = (*Projection.fields, SECOND_MOMENT, WALL_MOMENT, VELOCITY_GRADIENT, SURFACE_SHARE)

    number_density: NumberDensity = OriginalNumberDensity(weight=Isochoric())
    """Particle number density n."""
    free_surface: FreeSurface = ImagedSurface()
    """Detection of the free surface."""
    air: Air = Nowhere()
    """Air that the free surface encloses."""
    viscosity: Viscosity = Explicit(laplacian=Distance())
    """Viscosity."""
    divergence: Divergence = Bounded()
    """Divergence of the predicted velocity."""
    laplacian: Laplacian = CorrectedVector(base="distance", correction="lagged")
    """Laplacian of the pressure matrix."""
    gradient: Gradient = Imaged()
    """Gradient of the pressure."""
    source: Source = DivergenceDensity(smoothed=True)
    """Right side of the pressure Poisson equation; one that is evaluated at the start of the step."""
    shifting: Shifting = FickianAlongSurface()
    """Particle shifting."""
    volume_order: Literal[1, 2] = 2
    """Order in dt to which a step keeps the volume: 1 makes div u zero, 2 what it leaves of it as well [1]."""

    @model_validator(mode="after")
    def _air_beyond_images(self) -> Self:
        if self.air.key != "none" and not (self.free_surface.of_air and self.gradient.of_air):
            raise ValueError(
                f"air {self.air.key!r} acts through images beyond the surface, which free_surface "
                f"{self.free_surface.key!r} with gradient {self.gradient.key!r} does not have: choose imaged for both"
            )
        return self

    def begin(self, domain: Domain) -> None:
        """Prepare the state before the first step, which air that is enclosed from the beginning may limit."""
        super().begin(domain)
        self.air(domain.lattice, domain.particles, domain.voids, domain.pairs.periods)

    def max_dt(self, domain: Domain, speed: float) -> float:
        """Return the largest time step [s] that enclosed air allows."""
        return self.air.max_dt(domain.lattice, domain.particles, domain.voids)

    def __call__(self, domain: Domain, t: float, dt: float, before: float) -> dict[str, float]:
        """Advance the domain from t to t + dt: forces, project, move."""
        lattice, particles, pairs, bodies = domain.lattice, domain.particles, domain.pairs, domain.bodies
        tau = 0.5 * (before + dt)
        for body in bodies:
            body.prescribe(particles, t, dt)

        with domain.stages("search"):
            removed = pairs.update(particles)
        with domain.stages("forces"):
            accelerate(domain, t, tau)
            self.wall_model.show_slip(lattice, particles, pairs)
            viscous = self.viscosity.as_sums(lattice)
            sum_at_start(self, domain, viscous)
            if not viscous:
                self.viscosity(lattice, particles, pairs, tau)
            self.number_density(lattice, particles, pairs)
            self.wall_model.count_fluid(lattice, particles, pairs)
            self.free_surface(lattice, particles, pairs, self.number_density)
            trapped = self.air(lattice, particles, domain.voids, pairs.periods)
            self.source.remember(lattice, particles, pairs, self.number_density, self.wall_model.mirror)
            for body in bodies:
                body.force(particles, pairs, tau)
            row_map(accelerated, particles, out="velocity", rows=self.wall_model.predicted, arguments=(tau,))
            acceleration = particles.largest_norm("acceleration")

        outside = surface_pressure(self, domain, t)
        with domain.stages("source"):
            self.wall_model.neumann(particles, tau)
            self.source(lattice, particles, pairs, tau, self.divergence, self.number_density, self.wall_model.mirror)
            if self.volume_order == 2:
                keep_volume(self.divergence, lattice, particles, pairs, self.wall_model.mirror, dt / tau)
        figures = solve_pressure(self, domain, outside, dt * tau)
        with domain.stages("correction"):
            self.wall_model.extrapolate(lattice, particles, pairs)
            view = self.wall_model.view(tau, self.gradient.of_normals)
            self.gradient(lattice, particles, pairs, over=self.wall_model.carriers, view=view, dt=tau, moved=False)
            maps = (RowMap(corrected, "velocity", arguments=(tau,)), RowMap(moved, "position", arguments=(dt,)))
            row_maps(maps, particles)
            self.wall_model.rest(particles)
            for body in bodies:
                body.move(particles, t + dt)

        with domain.stages("tidying"):
            self.collision(lattice, particles, pairs, dt)
            self.shifting(lattice, particles, pairs, self.number_density, dt)
        for body in bodies:
            body.respond(particles, t, dt)
        return {**figures, **trapped, "removed": removed, "acceleration": acceleration}
