"""Inelastic collision of near pairs."""

from typing import ClassVar

from pydantic import Field as Parameter

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, PairSum, RowMap, pair_sums, pair_term, row_maps, row_term
from spume.particles import FLUID, SOLID, Field, Particles
from spume.schemes.collision.base import Collision
from spume.schemes.wall_faces import behind_face, within_face
from spume.schemes.weight.inverse import Inverse


@kernels.func
def meets_rim(b, r, distance, l0):  # type: ignore[no-untyped-def]
    """Return whether a row meets one of a wall as a body does, from beside its face.

    A row that falls on the rim of a wall comes from beside; no face would stop it.
    """
    normal = b.to_surface.normalized(1e-30)
    along = r.dot(normal) ** 2
    return along < r.norm_sqr() - along and r.norm_sqr() < (distance * l0) ** 2


@kernels.func
def at_face(b, r, distance, l0):  # type: ignore[no-untyped-def]
    """Return whether a row is behind the face of a wall, also between the rows that make the wall."""
    behind = behind_face(b, r) - (0.5 - distance) * l0
    return behind > 0.0 and within_face(b, r, l0) and not meets_rim(b, r, distance, l0)


@kernels.func
def contact(rate, r, dt):  # type: ignore[no-untyped-def]
    """Return along which direction two rows meet: r, or where it was at the start of the move if they have passed."""
    before = r - dt * rate
    return kernels.qd.select(before.dot(r) < 0.0, before, r)


@pair_term(reads=("velocity", "density"), shape=("d",))
def impulse(a, b, r, w, share, dt):  # type: ignore[no-untyped-def]
    part = b.density / (a.density + b.density)
    rate = b.velocity - a.velocity
    along = contact(rate, r, dt)
    return share * part * min(rate.dot(along), 0.0) / along.dot(along) * along


@pair_term(reads=("velocity",))
def counted(a, b, r, w, share, dt):  # type: ignore[no-untyped-def]
    rate = b.velocity - a.velocity
    return kernels.qd.cast(rate.dot(contact(rate, r, dt)) < 0.0, kernels.i32)


@pair_term(reads=("velocity", "to_surface"), shape=("d",))
def impulse_of_rim(a, b, r, w, share, distance, l0):  # type: ignore[no-untyped-def]
    result = 0.0 * r
    if meets_rim(b, r, distance, l0):
        # A wall is infinitely heavy: the fluid row takes the whole change of velocity.
        result = share * min((b.velocity - a.velocity).dot(r), 0.0) / r.dot(r) * r
    return result


@pair_term(reads=("velocity", "to_surface"), shape=("d",))
def impulse_of_wall(a, b, r, w, share, distance, l0):  # type: ignore[no-untyped-def]
    result = 0.0 * r
    if at_face(b, r, distance, l0):
        normal = b.to_surface.normalized(1e-30)
        result = share * max((b.velocity - a.velocity).dot(normal), 0.0) * normal
    return result


@pair_term(reads=("to_surface",))
def faces(a, b, r, w, share, distance, l0):  # type: ignore[no-untyped-def]
    return kernels.qd.cast(at_face(b, r, distance, l0), kernels.i32)


@pair_term(reads=("velocity", "to_surface"))
def counted_at_wall(a, b, r, w, share, distance, l0):  # type: ignore[no-untyped-def]
    normal = b.to_surface.normalized(1e-30)
    rate = b.velocity - a.velocity
    hit = meets_rim(b, r, distance, l0) and rate.dot(r) < 0.0
    return kernels.qd.cast(hit or (at_face(b, r, distance, l0) and rate.dot(normal) > 0.0), kernels.i32)


@row_term(reads=("collision_impulse", "rim_impulse", "wall_impulse", "faces"))
def together(a):  # type: ignore[no-untyped-def]
    return a.collision_impulse + a.rim_impulse + a.wall_impulse / max(a.faces, 1)


@row_term(reads=("collisions", "wall_collisions"))
def all_counted(a):  # type: ignore[no-untyped-def]
    return a.collisions + a.wall_collisions


@row_term(reads=("velocity", "collision_impulse"))
def changed_velocity(a, dt):  # type: ignore[no-untyped-def]
    return a.velocity + a.collision_impulse


@row_term(reads=("position", "collision_impulse"))
def changed_position(a, dt):  # type: ignore[no-untyped-def]
    return a.position + dt * a.collision_impulse


class Inelastic(Collision, name="inelastic"):
    """Pairs nearer than ``distance`` l0 that approach exchange momentum as bodies that collide.

    The approach speed v_n of the pair becomes -restitution v_n; both velocity and the move of this
    step are corrected (the customary treatment in MPS codes). A pair that has passed each other within the step met
    too, in the direction that it had before. Symmetric for pairs of fluid rows, so
    it conserves momentum. A wall is met at its face, as a plane, and at its rim as a row of particles.
    """

    reference: ClassVar = "lee2011"
    conserves: ClassVar = frozenset({"momentum"})
    needs: ClassVar = (
        Field("collision_impulse", ("d",), "m/s", "change of velocity by collisions", scratch="collision"),
        Field("collisions", (), "1", "number of colliding pairs of a row", int),
        Field(
            "wall_impulse", ("d",), "m/s", "sum of the changes of velocity by the faces of walls that a row touches",
            scratch="collision",
        ),
        Field(
            "rim_impulse", ("d",), "m/s", "change of velocity by the rows of walls that a row meets from beside",
            scratch="collision",
        ),
        Field("faces", (), "1", "number of solid rows whose face a row touches", int, scratch="collision"),
        Field("wall_collisions", (), "1", "number of solid rows that a row collides with", int, scratch="collision"),
    )  # fmt: skip

    distance: float = Parameter(default=0.5, gt=0.0, lt=1.0)
    """Distance below which a pair collides, as a multiple of l0 [1]."""
    restitution: float = Parameter(default=0.2, ge=0.0, le=1.0)
    """Share of the approach speed that is given back [1]."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, dt: float) -> None:
        """Change ``velocity`` and ``position`` of approaching near pairs; count in ``collisions``."""
        # Hardly any two fluid rows are as near as that: the loop over them is one that only asks.
        l0, share = lattice.spacing, 1.0 + self.restitution
        of_fluid = PairSum(
            (impulse, counted), ("collision_impulse", "collisions"), Inverse(), self.distance * l0,
            over=FLUID, arguments=(share, dt),
        )  # fmt: skip
        of_walls = PairSum(
            (impulse_of_rim, impulse_of_wall, faces, counted_at_wall),
            ("rim_impulse", "wall_impulse", "faces", "wall_collisions"), Inverse(), l0,
            over=SOLID, arguments=(share, self.distance, l0),
        )  # fmt: skip
        pair_sums((of_fluid, of_walls), particles, pairs)
        maps = (
            RowMap(together, "collision_impulse"),
            RowMap(all_counted, "collisions"),
            RowMap(changed_velocity, "velocity", arguments=(dt,)),
            RowMap(changed_position, "position", arguments=(dt,)),
        )
        row_maps(maps, particles)
