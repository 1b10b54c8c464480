"""The family of steps, and the row formulas that steps share."""

from collections.abc import Iterator, Sequence
from math import inf, sqrt
from typing import ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from spume import kernels
from spume.domain import Domain
from spume.named import Scheme
from spume.pairs import PairSum, pair_sums, row_map, row_term
from spume.particles import ANY, FLUID, WALL, Field, Particles
from spume.pressure.base import Solver
from spume.pressure.components import COMPONENT_FIELDS
from spume.pressure.matrix import BETWEEN_FLUIDS, SYSTEM_FIELDS, UNKNOWN
from spume.pressure.multigrid import Multigrid
from spume.schemes.collision.base import Collision
from spume.schemes.collision.inelastic import Inelastic
from spume.schemes.divergence.base import Divergence
from spume.schemes.divergence.original import Original as OriginalDivergence
from spume.schemes.free_surface.base import FreeSurface
from spume.schemes.free_surface.number_density import LowNumberDensity
from spume.schemes.gradient.base import Gradient, completing
from spume.schemes.gradient.corrected import Corrected
from spume.schemes.laplacian.base import Laplacian
from spume.schemes.laplacian.original import Original as OriginalLaplacian
from spume.schemes.number_density.base import NumberDensity
from spume.schemes.number_density.base import Original as OriginalNumberDensity
from spume.schemes.operator import Operator
from spume.schemes.relative_motion import RELATIVE_MOTION, relative_motion
from spume.schemes.shifting.base import Shifting
from spume.schemes.source.base import Source
from spume.schemes.viscosity.base import Viscosity
from spume.schemes.viscosity.explicit import Explicit
from spume.wall_models.base import WallModel
from spume.wall_models.neumann import Neumann


@row_term(reads=("position", "velocity"))
def acceleration_of_frame(a, gx, gy, gz, fx, fy, fz, xx, xy, xz, yx, yy, yz, zx, zy, zz, wx, wy, wz, dt):  # type: ignore[no-untyped-def]
    g = kernels.qd.Vector([gx, gy, gz])
    f = kernels.qd.Vector([fx, fy, fz])
    gradient = kernels.qd.Matrix([[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]])
    w = kernels.qd.Vector([wx, wy, wz])
    u = w * 0.0
    for k in kernels.static(range(a.velocity.n)):
        u[k] = a.velocity[k]
    # -2 w x u at the middle of the step, solved for: it turns the velocity and leaves its length.
    coriolis = -2.0 * w.cross(u)
    coriolis = (coriolis - dt * w.cross(coriolis)) / (1.0 + dt * dt * w.dot(w))
    result = a.position
    for k in kernels.static(range(result.n)):
        result[k] = g[k] + coriolis[k]
        for m in kernels.static(range(result.n)):
            result[k] += gradient[k, m] * (a.position[m] - f[m])
    return result


@row_term(reads=("velocity", "acceleration"))
def accelerated(a, dt):  # type: ignore[no-untyped-def]
    return a.velocity + dt * a.acceleration


@row_term(reads=("velocity", "pressure_gradient", "density", "fluid_neighbours"))
def corrected(a, dt):  # type: ignore[no-untyped-def]
    # A row without a fluid neighbour flies ballistically.
    share = kernels.qd.select(a.fluid_neighbours > 0, dt / a.density, 0.0)
    return a.velocity - share * a.pressure_gradient


@row_term(reads=("wall_velocity", "wall_acceleration"))
def accelerated_wall(a, dt):  # type: ignore[no-untyped-def]
    return a.wall_velocity + dt * a.wall_acceleration


@row_term(reads=("position", "velocity", "velocity_before"))
def moved_by_change(a, dt):  # type: ignore[no-untyped-def]
    return a.position + dt * (a.velocity - a.velocity_before)


@row_term(reads=("velocity",))
def copied_velocity(a):  # type: ignore[no-untyped-def]
    return a.velocity


@row_term(reads=("position", "velocity"))
def moved(a, dt):  # type: ignore[no-untyped-def]
    return a.position + dt * a.velocity


@row_term(reads=("pressure", "row_state", "surface_value"))
def known_or_guess(a):  # type: ignore[no-untyped-def]
    return kernels.qd.select(a.row_state == UNKNOWN, a.pressure, a.surface_value)


@row_term(reads=("number_density", "pressure_gradient", "density"))
def surface_value(a, n0, half, full):  # type: ignore[no-untyped-def]
    # What falls freely has no gradient and no pressure half a spacing inside. Iterated over the steps this settles
    # in a few: half of an error of the value comes back in the gradient. An impact must not raise it over rho g.
    value = min(half * a.pressure_gradient.norm(), full * a.density)
    # A flat surface has n/n0 of about 0.7. Spray and sheets hold no hydrostatic pressure at their centres.
    return value * min(max((a.number_density / n0 - 0.45) / 0.2, 0.0), 1.0)


@row_term(reads=("surface_diagonal",))
def stiffened(a, stiffness):  # type: ignore[no-untyped-def]
    return a.surface_diagonal + stiffness


@row_term(reads=("surface_diagonal", "surface_value", "pressure"))
def drawn_between(a, stiffness, kept):  # type: ignore[no-untyped-def]
    total = a.surface_diagonal * a.surface_value + stiffness * kept * a.pressure
    return total / (a.surface_diagonal + stiffness)


@row_term(reads=("pressure",))
def not_negative(a):  # type: ignore[no-untyped-def]
    return max(a.pressure, 0.0)


@row_term(reads=("pressure",))
def is_negative(a):  # type: ignore[no-untyped-def]
    return kernels.qd.cast(a.pressure < 0.0, kernels.i32)


CLIPPED = Field("clipped", (), "1", "1 where a negative pressure was set to zero", int)


class Step(Scheme, family="step"):
    """One time step of the whole domain: the slots that every step has.

    A concrete step sets their defaults; its text is the order in which they act.
    """

    number_density: NumberDensity = OriginalNumberDensity()
    """Particle number density n."""
    free_surface: FreeSurface = LowNumberDensity()
    """Detection of the free surface."""
    viscosity: Viscosity = Explicit()
    """Viscosity."""
    divergence: Divergence = OriginalDivergence()
    """Divergence of the predicted velocity."""
    gradient: Gradient = Corrected()
    """Gradient of the pressure."""
    negative_pressure: bool = True
    """Keep negative pressures; false clips them to zero, as the original method does."""
    wall_model: WallModel = Neumann()
    """What solid rows contribute."""
    collision: Collision = Inelastic()
    """Treatment of particles that come too close."""
    shifting: Shifting
    """Particle shifting."""

    steadiness: ClassVar[float] = 1.0
    """Part of the limit courant sqrt(l0/|a|) of the time step up to which a fluid at rest stays at rest."""
    fields: ClassVar[tuple[Field, ...]] = (*SYSTEM_FIELDS, CLIPPED, *RELATIVE_MOTION, *Corrected.needs)

    def __call__(self, domain: Domain, t: float, dt: float, before: float) -> dict[str, float]:
        """Advance the domain from t to t + dt; return figures of the step. ``before``: the step before [s], 0 at first.

        They are the largest ``acceleration`` [m/s^2] without the pressure's, which limits the next time step, and what
        logs count: iterations, residual, uses of limiters.
        """
        raise NotImplementedError

    def begin(self, domain: Domain) -> None:
        """Prepare the state before the first step: the gradient of the initial pressure and n, which the first uses."""
        domain.pairs.update(domain.particles)
        self.number_density(domain.lattice, domain.particles, domain.pairs)
        # Not the step's own model, which may want a time step or the images of a wall.
        Corrected()(domain.lattice, domain.particles, domain.pairs, over=FLUID, view=BETWEEN_FLUIDS)

    def relative_speed(self, domain: Domain) -> float:
        """Return the largest relative speed of a fluid row and a neighbour [m/s], as far as both are surrounded."""
        particles = domain.particles
        relative_motion(self.gradient, domain.lattice, particles, domain.pairs, self.number_density)
        return sqrt(max(particles.largest("surrounded_motion", FLUID), 0.0))

    def max_dt(self, domain: Domain, speed: float) -> float:
        """Return the largest time step [s] that the step itself allows, for the largest ``speed`` [m/s]."""
        return inf

    def caution(self) -> str:
        """Return which two models do not fit each other, though they can be computed together, or nothing."""
        return ""

    def needed_fields(self) -> tuple[Field, ...]:
        """Return every field that the step and the schemes in its slots need."""
        found = list(self.fields)
        for scheme in nested(self):
            found.extend(scheme.needed())
        return tuple(dict.fromkeys(found))

    def largest_radius(self) -> float:
        """Return the largest effective radius of any operator, as a multiple of l0."""
        return max(scheme.re for scheme in nested(self) if isinstance(scheme, Operator) and "re" not in scheme.unused)


class Projection(Step):
    """What steps share that solve a pressure Poisson equation."""

    source: Source
    """Right side of the pressure Poisson equation."""
    laplacian: Laplacian = OriginalLaplacian()
    """Laplacian of the pressure matrix."""
    solver: Solver = Multigrid()
    """Linear solver."""
    surface_pressure: Literal["half-cell", "zero"] = "half-cell"
    """Pressure at the centres of surface rows: l0/2 times the last pressure gradient there (rho |g| at most), or 0.

    Of a ``free_surface`` with a known pressure; ``imaged`` and ``detection-free`` solve for it.
    """

    instants: ClassVar[tuple[str, ...]] = ("k", "*")
    """Instants at which the step can evaluate a source."""
    fields: ClassVar[tuple[Field, ...]] = (*Step.fields, *COMPONENT_FIELDS)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.source.instant not in self.instants:
            raise ValueError(
                f"source {self.source.key!r} is evaluated at moved positions, which {self.key!r} does not have: "
                "choose divergence or divergence-density, or the step predict-move-project"
            )
        if self.wall_model.mirror and not self.source.from_velocity:
            raise ValueError(
                f"source {self.source.key!r} with wall_model {self.wall_model.key!r} counts the wall's flux twice: "
                "choose the wall_model resting, or the source divergence or divergence-density"
            )
        if not (self.free_surface.known or self.source.from_velocity):
            raise ValueError(
                f"free_surface {self.free_surface.key!r} with source {self.source.key!r}: neighbours missing at the "
                "surface would be taken for a stretched fluid; choose the source divergence or "
                "divergence-density, or a free_surface with a known pressure, such as blended"
            )
        if not self.free_surface.known and self.surface_pressure != type(self).model_fields["surface_pressure"].default:
            raise ValueError(
                f"surface_pressure has no effect with free_surface {self.free_surface.key!r}, which solves for it: "
                "leave it out, or choose a free_surface with a known pressure, such as blended"
            )
        if self.solver.symmetric_only and not self.laplacian.symmetric:
            raise ValueError(
                f"solver {self.solver.key!r} needs a symmetric matrix, which the laplacian {self.laplacian.key!r} "
                "does not give: choose multigrid or bicgstab"
            )
        return self

    def caution(self) -> str:
        """Return which two models do not fit each other, though they can be computed together, or nothing."""
        cautions = []
        source = self.source
        if found := self.laplacian.caution(source.of_slope, self.number_density, not source.from_velocity):
            cautions.append(f"source {source.key!r} {found}")
        if found := self.gradient.caution():
            cautions.append(f"gradient {self.gradient.key!r} {found}")
        if self.laplacian.completes and not self.free_surface.known:
            cautions.append(
                f"laplacian {self.laplacian.key!r} makes up for the neighbours missing at the surface, which "
                f"free_surface {self.free_surface.key!r} puts into the matrix as well, so that water at rest has up "
                "to a fifth too little pressure: choose distance, or corrected-vector with correction = 'lagged'"
            )
        if not (self.free_surface.known or self.gradient.completes):
            cautions.append(
                f"gradient {self.gradient.key!r} leaves out the neighbours missing at the surface, which free_surface "
                f"{self.free_surface.key!r} puts into the matrix, so that water at rest is not held: choose the "
                f"gradient {' or '.join(completing())}"
            )
        return "; ".join(cautions)


def nested(scheme: Scheme) -> Iterator[Scheme]:
    """Yield a scheme and every scheme among its parameters, recursively."""
    yield scheme
    for name in type(scheme).model_fields:
        value = getattr(scheme, name)
        if isinstance(value, Scheme):
            yield from nested(value)


def sum_at_start(step: Step, domain: Domain, more: Sequence[PairSum] = ()) -> None:
    """Make in one pass the sums that the models of a step ask for where it starts, and ``more``.

    Where two models want different sums in one field, the later one makes its own when it is called.
    """
    models = (step.number_density, step.wall_model, step.free_surface, step.divergence, step.viscosity)
    field_of: dict[str, PairSum] = {}
    sums = [
        s
        for s in (*(s for model in models for s in model.sums(domain.lattice)), *more)
        if all(field_of.setdefault(name, s) == s for name in s.out)
    ]
    pair_sums(sums, domain.particles, domain.pairs)


def accelerate(domain: Domain, t: float, dt: float) -> None:
    """Set ``acceleration`` of every row to gravity at the time t, and what a moving frame adds to it."""
    numbers = domain.force(t).numbers()
    row_map(acceleration_of_frame, domain.particles, out="acceleration", rows=ANY, arguments=(*numbers, dt))


def surface_pressure(step: Projection, domain: Domain, t: float) -> float:
    """Return |g| l0/2 [m^2/s^2]: the pressure over rho at the centres of a surface at rest, which lies l0/2 outside."""
    if step.surface_pressure == "zero":
        return 0.0
    g = float(np.linalg.norm(domain.gravity.at(t)))
    return 0.5 * g * domain.lattice.spacing


def solve_pressure(step: Projection, domain: Domain, surface_pressure: float, dt2: float) -> dict[str, float]:
    """Assemble and solve the pressure Poisson equation; return iterations and residual.

    Args:
        step, domain: of the equation.
        surface_pressure: see the function of that name.
        dt2: time [s] that the pressure acts, times that over which rows then move [s^2].

    Raises:
        NotConverged: see ``Solver``.
    """
    particles, system = domain.particles, domain.system
    with domain.stages("assembly"):
        step.wall_model.states(particles, step.free_surface.known)
        row_map(
            surface_value, particles, out="surface_value", rows=FLUID | WALL,
            arguments=(step.number_density.n0(domain.lattice), 0.5 * domain.lattice.spacing, surface_pressure),
        )  # fmt: skip
        step.free_surface.draw(domain.lattice, particles, step.laplacian, step.number_density)
        row_map(known_or_guess, particles, out="pressure", rows=ANY)
        if step.source.compressibility > 0.0:
            _compress(step.source, particles, dt2)
        system.assemble(step.laplacian, domain.lattice, particles, domain.pairs, over=step.wall_model.carriers)
        least = 1 if step.source.compressibility > 0.0 else step.free_surface.least_tie
        floating = domain.components.project(system, particles, least)
    with domain.stages("solve"):
        system.negligible = step.solver.volume_error / dt2
        solution = step.solver(system, particles)
        domain.components.centre(floating, particles)
    figures: dict[str, float] = {
        "iterations": solution.iterations,
        "residual": solution.residual,
        "clipped": 0,
        "fallbacks": solution.fallbacks,
    }
    if not step.negative_pressure:
        figures["clipped"] = _clip(particles)
    return figures


def _compress(source: Source, particles: Particles, dt2: float) -> None:
    """Draw every row to its pressure before, or to zero, with the weight alpha_c/dt^2: see ``compressibility``."""
    stiffness, kept = source.compressibility / dt2, 0.0 if source.of_volume else 1.0
    row_map(drawn_between, particles, out="surface_value", rows=FLUID | WALL, arguments=(stiffness, kept))
    row_map(stiffened, particles, out="surface_diagonal", rows=FLUID | WALL, arguments=(stiffness,))


def _clip(particles: Particles) -> float:
    row_map(is_negative, particles, out="clipped", rows=FLUID)
    row_map(not_negative, particles, out="pressure", rows=ANY)
    return particles.total("clipped", FLUID)
