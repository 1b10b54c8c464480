"""The original algorithm: predict, move, project at the moved positions."""

from typing import ClassVar, Literal

from spume.domain import Domain
from spume.pairs import row_map
from spume.particles import FLUID, SOLID, Field
from spume.schemes.free_surface.base import FreeSurface
from spume.schemes.free_surface.number_density import LowNumberDensity
from spume.schemes.gradient.base import Gradient
from spume.schemes.gradient.minimum import Minimum
from spume.schemes.shifting.base import Shifting
from spume.schemes.shifting.none import Unshifted
from spume.schemes.source.base import Source
from spume.schemes.source.density import Density
from spume.steps.base import (
    Projection,
    accelerate,
    accelerated,
    accelerated_wall,
    copied_velocity,
    corrected,
    moved,
    moved_by_change,
    solve_pressure,
    surface_pressure,
)
from spume.wall_models.base import WallModel
from spume.wall_models.resting import Resting


class PredictMoveProject(Projection, name="predict-move-project"):
    """Forces, r* = r + dt u*, projection at r*, then velocity and position are corrected (Koshizuka & Oka 1996).

    The pressure is evaluated at moved positions, which damps waves: an oscillation of period T loses
    about 2 pi^2 dt/T of its amplitude each period. Its defaults are the models of the original method but for the
    gradient (``minimum``, Koshizuka 1998; ``original`` is that of 1996), the collisions (``inelastic``, Lee 2011) and
    the radius of the Laplacians, 2.1 l0 where the papers have 3.1 to 4.0 l0.
    """

    ids: ClassVar = ("A1",)
    reference: ClassVar = "koshizuka1996"
    # The density source answers dt^2 g with a pressure of its own size: at four times this a resting column explodes.
    steadiness: ClassVar = 0.25
    fields: ClassVar = (*Projection.fields, Field("velocity_before", ("d",), "m/s", "predicted velocity"))

    source: Source = Density()
    """Right side of the pressure Poisson equation."""
    free_surface: FreeSurface = LowNumberDensity(beta=0.97)
    """Detection of the free surface."""
    gradient: Gradient = Minimum()
    """Gradient of the pressure."""
    wall_model: WallModel = Resting()
    """What solid rows contribute."""
    negative_pressure: bool = False
    """Keep negative pressures; false clips them to zero, as the original method does."""
    surface_pressure: Literal["half-cell", "zero"] = "zero"
    """Pressure at the centres of surface rows: l0/2 times the last pressure gradient there (rho |g| at most), or 0.

    Of a ``free_surface`` with a known pressure; ``imaged`` and ``detection-free`` solve for it.
    """
    shifting: Shifting = Unshifted()
    """Particle shifting."""

    def __call__(self, domain: Domain, t: float, dt: float, before: float) -> dict[str, float]:
        """Advance the domain from t to t + dt: predict, move, project."""
        lattice, particles, pairs, bodies = domain.lattice, domain.particles, domain.pairs, domain.bodies
        for body in bodies:
            body.prescribe(particles, t, dt)

        with domain.stages("search"):
            removed = pairs.update(particles)
        with domain.stages("source"):
            self.source.remember(lattice, particles, pairs, self.number_density, self.wall_model.mirror)
        with domain.stages("forces"):
            accelerate(domain, t, dt)
            self.wall_model.show_slip(lattice, particles, pairs)
            self.viscosity(lattice, particles, pairs, dt)
            for body in bodies:
                body.force(particles, pairs, dt)
            row_map(accelerated, particles, out="velocity", rows=self.wall_model.predicted, arguments=(dt,))
            acceleration = particles.largest_norm("acceleration")
            row_map(moved, particles, out="position", rows=FLUID, arguments=(dt,))
            for body in bodies:
                body.move(particles, t + dt)
            # What meets a wall meets it as it moves, not as the predictor accelerates its rows.
            self.wall_model.neumann(particles, dt)
            accelerates = self.wall_model.predicted & SOLID
            if accelerates:
                self.wall_model.rest(particles)
            self.collision(lattice, particles, pairs, dt)
            if accelerates:
                row_map(accelerated_wall, particles, out="velocity", rows=SOLID, arguments=(dt,))

        with domain.stages("search"):
            removed += pairs.update(particles)
        outside = surface_pressure(self, domain, t)
        with domain.stages("source"):
            self.number_density(lattice, particles, pairs)
            self.wall_model.count_fluid(lattice, particles, pairs)
            self.free_surface(lattice, particles, pairs, self.number_density)
            self.wall_model.neumann(particles, dt)
            self.source(lattice, particles, pairs, dt, self.divergence, self.number_density, self.wall_model.mirror)
        figures = solve_pressure(self, domain, outside, dt * dt)
        with domain.stages("correction"):
            self.wall_model.extrapolate(lattice, particles, pairs)
            view = self.wall_model.view(dt, self.gradient.of_normals)
            self.gradient(lattice, particles, pairs, over=self.wall_model.carriers, view=view, dt=dt)
            row_map(copied_velocity, particles, out="velocity_before", rows=FLUID)
            row_map(corrected, particles, out="velocity", rows=FLUID, arguments=(dt,))
            self.wall_model.rest(particles)
            row_map(moved_by_change, particles, out="position", rows=FLUID, arguments=(dt,))

        with domain.stages("tidying"):
            self.shifting(lattice, particles, pairs, self.number_density, dt)
        for body in bodies:
            body.respond(particles, t, dt)
        return {**figures, "removed": removed, "acceleration": acceleration}
