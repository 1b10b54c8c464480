"""The gradient corrected to be exact for linear fields."""

from typing import ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs, PairView, pair_sum, pair_term
from spume.particles import ANY, Particles
from spume.schemes.correction import CORRECTION, correction_matrix
from spume.schemes.gradient.base import Gradient


def _corrected(a, total, scale):  # type: ignore[no-untyped-def]
    return a.correction @ total * scale


@pair_term(reads=("value", "correction"), shape=("d",), finish=_corrected)
def difference(a, b, r, w, scale):  # type: ignore[no-untyped-def]
    return (b.value - a.value) * w / r.dot(r) * r


class Corrected(Gradient, name="corrected"):
    """<grad phi>_i = d/n0 sum_j (phi_j - phi_i)/r^2 C_i r_ij W (gradient correction, GC; review Eqs. 12-14).

    C_i = [d/n0 sum_j W r (x) r/r^2]^-1. Exact for linear fields on any arrangement; conserves no momentum.
    The choice for accurate pressures; it needs particle shifting, for it does not push particles apart.
    The print's normalisation is too large by the factor d; this is the consistent one.
    """

    ids: ClassVar = ("B6",)
    reference: ClassVar = "khayyer2011"
    order: ClassVar = 1
    needs: ClassVar = (CORRECTION,)

    largest_condition: float = 1e3
    """Largest condition number of the matrix; above it a row falls back to C = I [1]."""

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs,
        phi: str = "pressure", out: str = "pressure_gradient", over: int = ANY, view: PairView | None = None,
        dt: float = 0.0, moved: bool = True,
    ) -> None:  # fmt: skip
        """Write the gradient of ``phi`` at fluid rows into ``out``."""
        correction_matrix(self, lattice, particles, pairs, over, self.largest_condition)
        pair_sum(
            difference, particles, pairs, out=out, weight=self.weight, re=self.radius(lattice), over=over,
            arguments=(lattice.dimension / self.n0(lattice),), fields={"value": phi}, view=view,
        )  # fmt: skip
