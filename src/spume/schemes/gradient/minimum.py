"""The gradient model with the smallest neighbouring value, which only repels."""

from typing import ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs, PairView, pair_sum, pair_term
from spume.particles import ANY, Particles
from spume.schemes.gradient.base import Gradient
from spume.schemes.gradient.smallest import SMALLEST_VALUE, find_smallest


def _scaled(a, total, scale):  # type: ignore[no-untyped-def]
    return total * scale


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
    repels: ClassVar = True
    needs: ClassVar = (SMALLEST_VALUE,)

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs,
        phi: str = "pressure", out: str = "pressure_gradient", over: int = ANY, view: PairView | None = None,
        dt: float = 0.0, moved: bool = True,
    ) -> None:  # fmt: skip
        """Write the gradient of ``phi`` at fluid rows into ``out``; dummies are no candidates for the minimum."""
        find_smallest(self, lattice, particles, pairs, phi, over, view)
        pair_sum(
            above_smallest, particles, pairs, out=out, weight=self.weight, re=self.radius(lattice), over=over,
            arguments=(lattice.dimension / self.n0(lattice),), fields={"value": phi}, view=view,
        )  # fmt: skip
