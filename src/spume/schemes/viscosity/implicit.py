"""Implicit viscosity: a linear system of its own."""

from typing import Any, ClassVar, Self

from pydantic import model_validator

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, PairSum, PairTerm, RowTerm, pair_sum, pair_term, row_map, row_term
from spume.particles import ANY, FLUID, SOLID, Field, Particles
from spume.pressure.base import NotConverged, Solver
from spume.pressure.conjugate_gradient import ConjugateGradient
from spume.pressure.matrix import FLUX, UNKNOWN, Equation, LinearSystem
from spume.schemes.laplacian.base import Laplacian, Terms
from spume.schemes.laplacian.original import Original
from spume.schemes.turbulence.base import Turbulence
from spume.schemes.turbulence.none import Laminar
from spume.schemes.viscosity.base import Viscosity, refuse_lagged, shared_viscosity

VISCOUS_FIELDS = (
    Field("viscosity", (), "m^2/s", "kinematic viscosity of the system, with that of the turbulence"),
    Field("viscous_state", (), "1", "1 where the viscous change of velocity is unknown, 3 on solid rows", int),
    Field("viscous_diagonal", (), "kg/(m^3 s)", "diagonal of the viscous matrix"),
    Field("viscous_sides", ("d",), "N/m^3", "viscous force at the velocity to come, one right side per axis"),
    Field("viscous_rhs", (), "N/m^3", "one of the right sides"),
    Field("viscous_change", (), "m/s", "change of one component of the velocity"),
    Field("velocity_to_come", ("d",), "m/s", "velocity that the step would lead to without viscosity"),
)


@row_term(reads=("velocity", "acceleration", "pressure_gradient", "density"))
def to_come(a, dt):  # type: ignore[no-untyped-def]
    return a.velocity + dt * (a.acceleration - a.pressure_gradient / a.density)


@row_term(reads=("kind",))
def state_of(a):  # type: ignore[no-untyped-def]
    return kernels.qd.select(a.kind == FLUID, UNKNOWN, FLUX)


@row_term(reads=("value",))
def same(a):  # type: ignore[no-untyped-def]
    return a.value


@kernels.func
def wall_share(a, b, r):  # type: ignore[no-untyped-def]
    """Return (u_image - u_a)/(u_wall - u_a) for a solid row b: the profile is linear through the wall's surface."""
    depth = b.to_surface.norm()
    apart = -r.dot(b.to_surface) / max(depth, 1e-30)
    # Where b belongs to the far side of a thin plate there is no surface between the two.
    share = kernels.qd.select(apart > depth, apart / max(apart - depth, 1e-6 * depth), 1.0)
    return kernels.qd.select(b.slip == 1, 0.0, share)


@kernels.func
def _nothing(a):  # type: ignore[no-untyped-def]
    return 0.0


@kernels.func
def _nothing_yet(a, rate):  # type: ignore[no-untyped-def]
    return 0.0


@kernels.func
def _inertia(a, rate):  # type: ignore[no-untyped-def]
    return a.density * rate


@kernels.func
def _no_flux(a, b, r):  # type: ignore[no-untyped-def]
    return 0.0


_PAIR = ("density", "viscosity", "kind", "to_surface", "slip")
VISCOUS = Equation(
    pair=shared_viscosity, row=_nothing, diagonal=_inertia, right=_nothing_yet, outside=None, known=_nothing,
    flux=_no_flux, flux_share=wall_share, pair_reads=_PAIR, row_reads=(),
)  # fmt: skip
"""rho/dt w - div(mu grad w) = f of the change w of the velocity; it vanishes on no-slip walls."""


class Implicit(Viscosity, name="implicit"):
    """rho (u^v - u)/dt = div(mu grad u^v), solved for the velocity u^v at the end of the step: stable at any dt.

    Solved for is the change w = u^v - u' of the velocity u' = u + dt (a - grad P/rho) to which the other forces and
    the pressure of the step before would lead: rho/dt w - div(mu grad w) = div(mu grad u'), one symmetric positive
    matrix, one right side per axis. As the pressure takes part in u', water at rest feels no viscosity and a steady
    flow is steady whatever dt. No-slip walls stand in the matrix, u_wall + (u_wall - u) times the ratio of distances
    from the surface, so that linear profiles are exact and nothing is evaluated at the start of the step; free-slip
    walls exert no viscous force. First order in dt. For high viscosities and creeping flow; where dt is far below
    l0^2/nu anyway, ``explicit`` is cheaper. Momentum is conserved to the solver's tolerance.
    """

    ids: ClassVar = ("A6",)
    reference: ClassVar = "cummins1999"
    needs: ClassVar[tuple[Field, ...]] = VISCOUS_FIELDS

    laplacian: Laplacian = Original()
    """Laplacian model."""
    turbulence: Turbulence = Laminar()
    """Turbulence model, which adds to the viscosity."""
    solver: Solver = ConjugateGradient(tolerance=1e-6)
    """Linear solver."""

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        refuse_lagged(self.laplacian)
        if self.solver.symmetric_only and not self.laplacian.symmetric:
            raise ValueError(
                f"solver {self.solver.key!r} needs a symmetric matrix, which the laplacian {self.laplacian.key!r} "
                "does not give: choose bicgstab or multigrid"
            )
        return self

    def sums(self, lattice: Lattice) -> tuple[PairSum, ...]:
        """Return those of the turbulence model."""
        return self.turbulence.sums(lattice)

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, dt: float) -> None:
        """Add (u^v - u')/dt to ``acceleration`` [m/s^2] of fluid rows.

        Raises:
            NotConverged: the solver did not reach its tolerance.
        """
        model, system = self.laplacian, _system()
        viscosity = self.turbulence(lattice, particles, pairs)
        row_map(same, particles, out="viscosity", rows=ANY, fields={"value": viscosity})
        row_map(to_come, particles, out="velocity_to_come", rows=FLUID, arguments=(dt,))
        row_map(state_of, particles, out="viscous_state", rows=FLUID | SOLID)
        system.assemble(model, lattice, particles, pairs, equation=VISCOUS, arguments=(1.0 / dt,))
        pair_sum(
            _force_term(model.terms()), particles, pairs, out="viscous_sides", weight=model.weight,
            re=model.radius(lattice), arguments=(model.scale(lattice),),
        )  # fmt: skip
        for axis in range(lattice.dimension):
            row_map(_component(axis), particles, out="viscous_rhs", rows=ANY)
            row_map(no_guess, particles, out="viscous_change", rows=ANY)
            try:
                self.solver(system, particles)
            except NotConverged as error:
                raise NotConverged(f"viscosity: {error}") from None
            row_map(_accelerated(axis), particles, out="acceleration", rows=FLUID, arguments=(1.0 / dt,))

    def largest(self, particles: Particles, material: float) -> float:
        """Return the largest kinematic viscosity [m^2/s], of the turbulence in the step before too."""
        return max(material, self.turbulence.largest(particles))


@row_term()
def no_guess(a):  # type: ignore[no-untyped-def]
    return 0.0


@kernels.cached
def _system() -> LinearSystem:
    """Return the system's storage, which serves every step and every simulation; each step fills it anew."""
    return LinearSystem(
        solution="viscous_change", state="viscous_state", diagonal="viscous_diagonal", rhs="viscous_rhs"
    )


@kernels.cached
def _component(axis: int) -> RowTerm:
    def component(a):  # type: ignore[no-untyped-def]
        return a.viscous_sides[axis]

    return RowTerm(kernels.func(component), ("viscous_sides",))


@kernels.cached
def _accelerated(axis: int) -> RowTerm:
    def accelerated(a, rate):  # type: ignore[no-untyped-def]
        result = a.acceleration
        result[axis] += rate * a.viscous_change
        return result

    return RowTerm(kernels.func(accelerated), ("acceleration", "viscous_change"))


@kernels.cached
def _force_term(terms: Terms) -> PairTerm:
    """Return the viscous force of a pair at the velocity to come."""
    coefficient: Any = terms.coefficient

    def scaled(a, total, scale):  # type: ignore[no-untyped-def]
        return scale * total

    @pair_term(
        reads=("velocity_to_come", "wall_velocity", *_PAIR, *terms.reads),
        shape=("d",),
        finish=scaled,
    )
    def force(a, b, r, w, scale):  # type: ignore[no-untyped-def]
        difference = b.velocity_to_come - a.velocity_to_come
        if b.kind != FLUID:
            difference = wall_share(a, b, r) * (b.wall_velocity - a.velocity_to_come)
        return shared_viscosity(a, b) * coefficient(a, b, r, w) * difference

    return force
