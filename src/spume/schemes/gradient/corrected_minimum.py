"""The corrected gradient with the smallest neighbouring value."""

from typing import ClassVar

from pydantic import Field as Parameter

from spume.lattice import Lattice
from spume.pairs import Pairs, PairView, pair_sum, pair_term
from spume.particles import ANY, Particles
from spume.schemes.correction import CORRECTION, correction_matrix
from spume.schemes.gradient.base import Gradient
from spume.schemes.gradient.smallest import SMALLEST_VALUE, find_smallest


def _corrected(a, total, scale):  # type: ignore[no-untyped-def]
    return a.correction @ total * scale


@pair_term(reads=("value", "smallest_value", "correction"), shape=("d",), finish=_corrected)
def above_smallest(a, b, r, w, scale):  # type: ignore[no-untyped-def]
    return (b.value - a.smallest_value) * w / r.dot(r) * r


class CorrectedMinimum(Gradient, name="corrected-minimum"):
    """<grad P>_i = d/n0 sum_j (P_j - Pmin_i)/r^2 C_i r_ij W (Wang 2017; review Eq. 15).

    Pmin_i is the least of P_i and the P_j, C_i the matrix of the corrected gradient. It equals the corrected
    gradient plus (P_i - Pmin_i) d/n0 C_i sum_j r_ij/r^2 W, which points from crowded to empty places: it keeps
    particles apart, but on an irregular arrangement not even linear fields are exact, whatever the matrix.
    Less noisy than the minimum alone; unusable where pressure is negative (tension).
    """

    ids: ClassVar = ("B7",)
    reference: ClassVar = "wang2017"
    order: ClassVar = 0
    repels: ClassVar = True
    needs: ClassVar = (CORRECTION, SMALLEST_VALUE)

    largest_condition: float = Parameter(default=1e3, gt=1.0)
    """Largest condition number of the matrix; above it a row falls back to C = I [1]."""

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs,
        phi: str = "pressure", out: str = "pressure_gradient", over: int = ANY, view: PairView | None = None,
        dt: float = 0.0, moved: bool = True,
    ) -> None:  # fmt: skip
        """Write the gradient of ``phi`` at fluid rows into ``out``; dummies are no candidates for the minimum."""
        correction_matrix(self, lattice, particles, pairs, over, self.largest_condition)
        find_smallest(self, lattice, particles, pairs, phi, over, view)
        pair_sum(
            above_smallest, particles, pairs, out=out, weight=self.weight, re=self.radius(lattice), over=over,
            arguments=(lattice.dimension / self.n0(lattice),), fields={"value": phi}, view=view,
        )  # fmt: skip
