"""Inelastic collision of near pairs."""

from typing import ClassVar

from pydantic import Field as Parameter

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, pair_sum, pair_term, row_map, row_term
from spume.particles import FLUID, Field, Particles
from spume.schemes.collision.base import Collision
from spume.schemes.weight.inverse import Inverse


@pair_term(reads=("velocity", "density", "kind"), shape=("d",))
def impulse(a, b, r, w, share):  # type: ignore[no-untyped-def]
    rate = (b.velocity - a.velocity).dot(r)
    # A solid row is infinitely heavy: the fluid row takes the whole change of velocity.
    part = kernels.qd.select(b.kind == FLUID, b.density / (a.density + b.density), 1.0)
    return share * part * min(rate, 0.0) / r.dot(r) * r


@pair_term(reads=("velocity",))
def counted(a, b, r, w, share):  # type: ignore[no-untyped-def]
    return kernels.qd.cast((b.velocity - a.velocity).dot(r) < 0.0, kernels.i32)


@row_term(reads=("velocity", "collision_impulse"))
def changed_velocity(a, dt):  # type: ignore[no-untyped-def]
    return a.velocity + a.collision_impulse


@row_term(reads=("position", "collision_impulse"))
def changed_position(a, dt):  # type: ignore[no-untyped-def]
    return a.position + dt * a.collision_impulse


class Inelastic(Collision, name="inelastic"):
    """Pairs nearer than ``distance`` l0 that approach exchange momentum as bodies that collide.

    The approach speed v_n of the pair becomes -restitution v_n; both velocity and the move of this
    step are corrected (the customary treatment in MPS codes). Symmetric for pairs of fluid rows, so
    it conserves momentum.
    """

    reference: ClassVar = "lee2011"
    conserves: ClassVar = frozenset({"momentum"})
    needs: ClassVar = (
        Field("collision_impulse", ("d",), "m/s", "change of velocity by collisions"),
        Field("collisions", (), "1", "number of colliding pairs of a row", int),
    )

    distance: float = Parameter(default=0.5, gt=0.0, lt=1.0)
    """Distance below which a pair collides, as a multiple of l0 [1]."""
    restitution: float = Parameter(default=0.2, ge=0.0, le=1.0)
    """Share of the approach speed that is given back [1]."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, dt: float) -> None:
        """Change ``velocity`` and ``position`` of approaching near pairs; count in ``collisions``."""
        pair_sum(
            (impulse, counted), particles, pairs, out=("collision_impulse", "collisions"), weight=Inverse(),
            re=self.distance * lattice.spacing, arguments=(1.0 + self.restitution,),
        )  # fmt: skip
        row_map(changed_velocity, particles, out="velocity", arguments=(dt,))
        row_map(changed_position, particles, out="position", arguments=(dt,))
