"""The family of wall models."""

from typing import ClassVar

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, PairSum, PairView, pair_sums, pair_term, row_map, row_term
from spume.particles import DUMMY, FLUID, SOLID, WALL, Field, Particles
from spume.pressure.matrix import ABSENT, BETWEEN_FLUIDS, KNOWN, UNKNOWN
from spume.schemes.operator import Operator
from spume.wall_models.slip import SLIP_FIELDS, image_velocities

WALL_FIELDS = (
    Field("wall_velocity", ("d",), "m/s", "solid rows: velocity of the wall", restart=True),
    *SLIP_FIELDS,
    Field("fluid_neighbours", (), "1", "number of fluid rows nearer than re", int),
)


@row_term(reads=("kind", "free_surface", "fluid_neighbours"))
def state_of_row(a, wall_state, dummy_state, surface_state):  # type: ignore[no-untyped-def]
    state = kernels.qd.select(a.free_surface == 1, kernels.qd.cast(surface_state, kernels.i32), UNKNOWN)
    # A wall row that no fluid touches has no equation, nor a fluid row that flies alone.
    if a.fluid_neighbours == 0:
        state = kernels.qd.select(a.kind == FLUID, KNOWN, ABSENT)
    elif a.kind == WALL and wall_state != UNKNOWN:
        state = kernels.qd.cast(wall_state, kernels.i32)
    if a.kind == DUMMY:
        state = kernels.qd.cast(dummy_state, kernels.i32)
    return state


@pair_term(reads=("kind",))
def is_fluid(a, b, r, w):  # type: ignore[no-untyped-def]
    return kernels.qd.cast(b.kind == FLUID, kernels.i32)


@row_term(reads=("wall_velocity",))
def at_rest_on_wall(a):  # type: ignore[no-untyped-def]
    return a.wall_velocity


@row_term(reads=("acceleration",))
def acceleration_at_rest(a):  # type: ignore[no-untyped-def]
    return a.acceleration


class WallModel(Operator, family="wall_model"):
    """What solid rows contribute to source, matrix, gradient and viscosity."""

    needs: ClassVar[tuple[Field, ...]] = WALL_FIELDS
    carriers: ClassVar[int]
    """Kinds of rows that carry a pressure in gradients."""
    mirror: ClassVar[bool] = False
    """Whether solid rows move like mirror images in the divergence (see ``Divergence``)."""
    predicted: ClassVar[int] = FLUID
    """Kinds of rows that the predictor accelerates as if they were fluid."""
    wall_state: ClassVar[int] = UNKNOWN
    """State of wall rows in the matrix, where fluid touches them."""
    dummy_state: ClassVar[int] = ABSENT
    """State of dummy rows in the matrix."""

    def sums(self, lattice: Lattice) -> tuple[PairSum, ...]:
        """Return the count of fluid rows."""
        return (PairSum((is_fluid,), ("fluid_neighbours",), self.weight, self.radius(lattice), rows=FLUID | WALL),)

    def count_fluid(self, lattice: Lattice, particles: Particles, pairs: Pairs) -> None:
        """Write ``fluid_neighbours`` of fluid and wall rows."""
        pair_sums(self.sums(lattice), particles, pairs)

    def states(self, particles: Particles, surface_known: bool = True) -> None:
        """Write ``row_state`` of every row; ``surface_known``: rows on the free surface have a known pressure."""
        row_map(
            state_of_row,
            particles,
            out="row_state",
            rows=FLUID | SOLID,
            arguments=(float(self.wall_state), float(self.dummy_state), float(KNOWN if surface_known else UNKNOWN)),
        )

    def neumann(self, particles: Particles, dt: float) -> None:
        """Write ``wall_acceleration`` [m/s^2] of solid rows: here that of the frame, as of a wall at rest in it.

        The source then sees them move as their wall does at the end of the step.
        """
        row_map(acceleration_at_rest, particles, out="wall_acceleration", rows=SOLID)
        self.rest(particles)

    def view(self, dt: float, of_normals: bool = False) -> PairView:
        """Return how a fluid row sees the pressure of a neighbour: here as the field says, across an interface as in
        `BETWEEN_FLUIDS`.

        Args:
            dt: time that the pressure acts [s].
            of_normals: whether the gradient can do with how the pressure changes along a wall's normal.
        """
        return BETWEEN_FLUIDS

    def show_slip(self, lattice: Lattice, particles: Particles, pairs: Pairs) -> None:
        """Write ``slip_velocity`` of every row, for viscosity."""
        image_velocities(self, lattice, particles, pairs)

    def rest(self, particles: Particles) -> None:
        """Give solid rows the velocity of their wall again."""
        row_map(at_rest_on_wall, particles, out="velocity", rows=SOLID, dry=True)

    def extrapolate(self, lattice: Lattice, particles: Particles, pairs: Pairs) -> None:
        """Write ``pressure`` of the solid rows that the matrix does not solve for."""
