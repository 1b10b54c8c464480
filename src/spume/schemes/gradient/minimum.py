"""The gradient model with the smallest neighbouring value, which only repels."""

from typing import Any, ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs, PairView, pair_min, pair_sum, pair_term
from spume.particles import ANY, FLUID, WALL, Field, Particles
from spume.schemes.gradient.base import Gradient


def _or_own(a, smallest):  # type: ignore[no-untyped-def]
    return min(a.value, smallest)


def _scaled(a, total, scale):  # type: ignore[no-untyped-def]
    return total * scale


@pair_term(reads=("value",), finish=_or_own)
def neighbour_value(a, b, r, w):  # type: ignore[no-untyped-def]
    return b.value


@pair_term(reads=("value", "smallest_value"), shape=("d",), finish=_scaled)
def above_smallest(a, b, r, w, scale):  # type: ignore[no-untyped-def]
    return (b.value - a.smallest_value) * w / r.dot(r) * r


class Minimum(Gradient, name="minimum"):
    """<grad P>_i = d/n0 sum_j (P_j - Pmin_i)/r^2 r_ij W (Koshizuka 1998; review Eq. 8).

    Pmin_i is the least of P_i and the P_j.

    Every pair repels, which keeps particles apart without shifting. Not even constants on an irregular
    arrangement are exact once pressures differ, so it is noisy; unusable where pressure is negative (tension).
    """

    ids: ClassVar = ("B2",)
    reference: ClassVar = "koshizuka1998"
    order: ClassVar = 0
    needs: ClassVar = (Field("smallest_value", (), "Pa", "smallest pressure of a row and its neighbours"),)

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs,
        phi: str = "pressure", out: str = "pressure_gradient", over: int = ANY, view: PairView | None = None,
    ) -> None:  # fmt: skip
        """Write the gradient of ``phi`` at fluid rows into ``out``; dummies are no candidates for the minimum."""
        seen = {"fields": {"value": phi}, "view": view}
        reach: dict[str, Any] = {"weight": self.weight, "re": self.radius(lattice), **seen}
        pair_min(neighbour_value, particles, pairs, out="smallest_value", over=over & (FLUID | WALL), **reach)
        pair_sum(
            above_smallest, particles, pairs, out=out, over=over,
            arguments=(lattice.dimension / self.n0(lattice),), **reach,
        )  # fmt: skip
