"""The gradient as a sum of the two values of a pair, which conserves momentum."""

from typing import ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs, PairView, pair_sum, pair_term
from spume.particles import ANY, Particles
from spume.schemes.gradient.base import Gradient


def _scaled(a, total, scale):  # type: ignore[no-untyped-def]
    return total * scale


@pair_term(reads=("value",), shape=("d",), finish=_scaled)
def both(a, b, r, w, scale):  # type: ignore[no-untyped-def]
    return (b.value + a.value) * w / r.dot(r) * r


class Sum(Gradient, name="sum"):
    """<grad P>_i = d/n0 sum_j (P_j + P_i)/r^2 r_ij W (Tanaka & Masunaga 2010; review Eq. 10).

    The forces of a pair are equal, opposite and along the line between the two, so momentum and angular momentum
    are conserved. Exact for linear fields on the regular arrangement; on an irregular one not even a constant has
    no gradient: 2 P d/n0 sum_j r_ij/r^2 W remains, which grows with the pressure, drives particles apart where it
    is positive and together where it is negative. So it needs P >= 0. Prefer it for impacts, where conservation
    counts and pressures are short; a deep pool at rest is noisy with it.
    """

    ids: ClassVar = ("B4",)
    reference: ClassVar = "tanaka2010"
    order: ClassVar = -1
    conserves: ClassVar = frozenset({"momentum", "angular momentum"})
    repels: ClassVar = True

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs,
        phi: str = "pressure", out: str = "pressure_gradient", over: int = ANY, view: PairView | None = None,
        dt: float = 0.0, moved: bool = True,
    ) -> None:  # fmt: skip
        """Write the gradient of ``phi`` at fluid rows into ``out``."""
        pair_sum(
            both, particles, pairs, out=out, weight=self.weight, re=self.radius(lattice), over=over,
            arguments=(lattice.dimension / self.n0(lattice),), fields={"value": phi}, view=view,
        )  # fmt: skip
