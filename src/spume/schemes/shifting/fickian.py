"""Particle shifting by Fick's law."""

from typing import Any, ClassVar

from pydantic import Field as Parameter

from spume.lattice import Lattice
from spume.pairs import Pairs, pair_sum, pair_term, row_map, row_term
from spume.particles import ANY, FLUID, Field, Particles
from spume.schemes.shifting.base import Shifting


def _shift(a, crowding, scale, largest):  # type: ignore[no-untyped-def]
    shift = -scale * crowding
    # On the surface only along it: across it the crowding is one-sided and would push rows out.
    if a.surface_share > 0.0:
        outward = crowding.normalized(1e-12)
        shift -= a.surface_share * shift.dot(outward) * outward
    length = shift.norm()
    if length > largest:
        shift *= largest / length
    return shift


@pair_term(reads=("surface_share",), shape=("d",), finish=_shift)
def crowding(a, b, r, w, scale, largest):  # type: ignore[no-untyped-def]
    return w / r.dot(r) * r


@row_term(reads=("position", "shift"))
def shifted(a):  # type: ignore[no-untyped-def]
    return a.position + a.shift


class Fickian(Shifting, name="fickian"):
    """delta r_i = -A l0^2 d/n0 sum_j W r_ij/r^2: from crowded to empty places (after Xu 2009).

    The sum is the gradient of the concentration in MPS form. On the free surface the normal part is left out.
    """

    ids: ClassVar = ("D1",)
    reference: ClassVar = "xu2009"
    needs: ClassVar = (Field("shift", ("d",), "m", "displacement by particle shifting"),)

    strength: float = Parameter(default=0.1, ge=0.0, le=1.0)
    """Coefficient A [1]."""
    largest: float = Parameter(default=0.1, gt=0.0, le=0.5)
    """Largest displacement in one step, as a multiple of l0 [1]."""

    def __call__(
        self,
        lattice: Lattice,
        particles: Particles,
        pairs: Pairs,
        number_density: Any,
        largest_speed: float,
        dt: float,
    ) -> None:
        """Shift ``position`` of fluid rows; ``shift`` keeps the displacement."""
        scale = self.strength * lattice.spacing**2 * lattice.dimension / self.n0(lattice)
        pair_sum(
            crowding, particles, pairs, out="shift", weight=self.weight, re=self.radius(lattice), over=ANY,
            arguments=(scale, self.largest * lattice.spacing),
        )  # fmt: skip
        row_map(shifted, particles, out="position", rows=FLUID)
