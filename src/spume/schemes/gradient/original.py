"""The gradient model of the original method, without a minimum pressure."""

from typing import ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs, PairView, pair_sum, pair_term
from spume.particles import ANY, Particles
from spume.schemes.gradient.base import Gradient


def _scaled(a, total, scale):  # type: ignore[no-untyped-def]
    return total * scale


@pair_term(reads=("value",), shape=("d",), finish=_scaled)
def difference(a, b, r, w, scale):  # type: ignore[no-untyped-def]
    return (b.value - a.value) * w / r.dot(r) * r


class Original(Gradient, name="original"):
    """<grad phi>_i = d/n0 sum_j (phi_j - phi_i)/r^2 r_ij W (Koshizuka & Oka 1996; review Eq. 3).

    Exact for linear fields on the regular arrangement, for constants on any. Conserves no momentum.
    With pressures it attracts particles into streaks unless shifting keeps them apart.
    """

    ids: ClassVar = ("A3", "B1")
    reference: ClassVar = "koshizuka1996"
    order: ClassVar = 0

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs,
        phi: str = "pressure", out: str = "pressure_gradient", over: int = ANY, view: PairView | None = None,
        dt: float = 0.0, moved: bool = True,
    ) -> None:  # fmt: skip
        """Write the gradient of ``phi`` at fluid rows into ``out``."""
        pair_sum(
            difference, particles, pairs, out=out, weight=self.weight, re=self.radius(lattice), over=over,
            arguments=(lattice.dimension / self.n0(lattice),), fields={"value": phi}, view=view,
        )  # fmt: skip
