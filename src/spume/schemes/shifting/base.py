"""The family of particle shifting models, and what its members share."""

from typing import Any, ClassVar

from pydantic import Field as Parameter

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, pair_sum, pair_term, row_map, row_term
from spume.particles import FLUID, SOLID, Field, Particles
from spume.schemes.correction import CORRECTION, correction_matrix
from spume.schemes.operator import Operator
from spume.schemes.wall_faces import behind_face, within_face

_CARRIED = (
    Field("shifted_velocity", ("d",), "m/s", "velocity at the shifted position", scratch="shift"),
    Field("shifted_pressure", (), "Pa", "pressure at the shifted position", scratch="shift"),
)

SHIFT = Field("shift", ("d",), "m", "displacement by particle shifting")
HELD_BY_WALL = Field("held_by_wall", (), "1", "number of wall rows behind whose surface the shift would go on", int)

_REACH = 1.1
"""Distance of a wall row from a row on its surface, which is up to a spacing above it on a slope [l0]."""


class Shifting(Operator, family="shifting"):
    """Moves fluid rows slightly, from crowded to empty places, after the step."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any, dt: float) -> None:
        """Shift ``position`` of fluid rows.

        Args:
            number_density: the ``NumberDensity`` scheme.
            dt: time step [s].
        """
        raise NotImplementedError


def _changed_velocity(a, total, scale):  # type: ignore[no-untyped-def]
    return a.velocity + scale * total


def _changed_pressure(a, total, scale):  # type: ignore[no-untyped-def]
    return a.pressure + scale * total


@pair_term(reads=("velocity", "correction", "shift"), shape=("d",), finish=_changed_velocity)
def velocity_along_shift(a, b, r, w, scale):  # type: ignore[no-untyped-def]
    return (b.velocity - a.velocity) * (r.dot(a.correction @ a.shift) * w / r.dot(r))


@pair_term(reads=("pressure", "correction", "shift"), finish=_changed_pressure)
def pressure_along_shift(a, b, r, w, scale):  # type: ignore[no-untyped-def]
    return (b.pressure - a.pressure) * (r.dot(a.correction @ a.shift) * w / r.dot(r))


@pair_term(reads=("shift", "to_surface"))
def further_into_wall(a, b, r, w, l0):  # type: ignore[no-untyped-def]
    further = behind_face(b, r) > 0.0 and within_face(b, r, l0) and a.shift.dot(b.to_surface) < 0.0
    return kernels.qd.cast(further, kernels.i32)


@row_term(reads=("shift", "held_by_wall"))
def unless_held(a):  # type: ignore[no-untyped-def]
    return kernels.qd.select(a.held_by_wall > 0, 0.0, 1.0) * a.shift


@row_term(reads=("position", "shift"))
def shifted(a):  # type: ignore[no-untyped-def]
    return a.position + a.shift


@row_term(reads=("shifted_velocity",))
def carried_velocity(a):  # type: ignore[no-untyped-def]
    return a.shifted_velocity


@row_term(reads=("shifted_pressure",))
def carried_pressure(a):  # type: ignore[no-untyped-def]
    return a.shifted_pressure


class Diffusive(Shifting):
    """What shifting by delta r = -D grad C shares: the coefficient D, the largest step, the carried fields.

    In MPS form the gradient of the concentration is grad C_i = d/n0 sum_j W r_ij/r^2, the sum over
    V_j grad W of the papers with V_j grad W = d/n0 W r_ij/r^2. Their smoothing length is h = re/3, as of a
    kernel whose support is 3 h: D = h^2/2 is then 0.245 l0^2 at re = 2.1 l0, six tenths of the D at which the
    lattice becomes unstable to its own correction (0.415 l0^2 in 2D, 0.468 l0^2 in 3D).
    """

    needs: ClassVar[tuple[Field, ...]] = (SHIFT, HELD_BY_WALL, CORRECTION, *_CARRIED)

    largest: float = Parameter(default=0.1, gt=0.0, le=0.5)
    """Largest displacement in one step, as a multiple of l0 [1]."""
    correct_fields: bool = False
    """Carry velocity and pressure to the new place, u(r + dr) = u + dr . grad u, as Xu 2009 and Lind 2012 do."""

    def needed(self) -> tuple[Field, ...]:
        """Return the needed fields, without those that only ``correct_fields`` uses."""
        return tuple(f for f in self.needs if self.correct_fields or f not in _CARRIED)

    def smoothing_length(self, lattice: Lattice) -> float:
        """Return h = re/3 [m]."""
        return self.radius(lattice) / 3.0

    def shift(self, lattice: Lattice, particles: Particles, pairs: Pairs) -> None:
        """Add ``shift`` to ``position`` of fluid rows; with ``correct_fields`` take the fields to the new place.

        A row that is behind the surface of a wall is not shifted further into it. A sloping wall is a staircase of
        rows, up to a spacing below its surface. Shifting takes that for an empty place: rows would sink into it, and
        creep on below the next stair.

        The gradients are corrected (exact for linear fields on any arrangement) and sum over the fluid alone, for
        across a wall velocity and pressure are no smooth fields.
        """
        l0 = lattice.spacing
        pair_sum(
            further_into_wall, particles, pairs, out="held_by_wall", weight=self.weight, re=_REACH * l0, over=SOLID,
            arguments=(l0,),
        )  # fmt: skip
        row_map(unless_held, particles, out="shift", rows=FLUID)
        if self.correct_fields:
            correction_matrix(self, lattice, particles, pairs, FLUID, rows=FLUID)
            pair_sum(
                (velocity_along_shift, pressure_along_shift), particles, pairs,
                out=("shifted_velocity", "shifted_pressure"), weight=self.weight, re=self.radius(lattice), over=FLUID,
                arguments=(lattice.dimension / self.n0(lattice),),
            )  # fmt: skip
            row_map(carried_velocity, particles, out="velocity", rows=FLUID)
            row_map(carried_pressure, particles, out="pressure", rows=FLUID)
        row_map(shifted, particles, out="position", rows=FLUID)


def advective_diffusivity(
    scheme: Diffusive, factor: float | None, constant: float, lattice: Lattice, particles: Particles, dt: float
) -> float:
    """Return D [m^2]: ``constant``, or where a factor is given A h |u|max dt, at most h^2/2."""
    if factor is None:
        return constant
    h = scheme.smoothing_length(lattice)
    return min(factor * h * particles.largest_norm("velocity", FLUID) * dt, 0.5 * h * h)
