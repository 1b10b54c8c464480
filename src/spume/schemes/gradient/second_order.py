"""The gradient corrected to be exact for quadratic fields."""

from typing import ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs, PairView, pair_sum, pair_term
from spume.particles import ANY, FLUID, Particles
from spume.schemes.gradient.base import Gradient
from spume.schemes.second_order import FIT_DEGREE, GRADIENT_VECTORS, basis, second_order_vectors


def _scaled(a, total, scale, l0):  # type: ignore[no-untyped-def]
    return total * scale


@pair_term(reads=("value", "gradient_vectors"), shape=("d",), finish=_scaled)
def difference(a, b, r, w, scale, l0):  # type: ignore[no-untyped-def]
    return (b.value - a.value) * w * l0 * l0 / r.dot(r) * (a.gradient_vectors @ basis(r, l0))


class SecondOrder(Gradient, name="second-order"):
    """<grad phi>_i = 1/n0 sum_j W (phi_j - phi_i)/r (C_1, C_2[, C_3])^T p_ij (SCM, Duan 2019; review Eqs. 18-20).

    p = (x/r, y/r, x^2/(l0 r), y^2/(l0 r), xy/(l0 r)), in 3D with z, z^2, yz and zx likewise;
    C_k is the k-th row of C = [1/n0 sum_j W p (x) p]^-1. Exact for quadratic fields on any arrangement, of second
    order; conserves no momentum. A row whose neighbours do not determine all the second derivatives falls back to
    first order, then to the uncorrected gradient; the field ``fit_degree`` says which rows did (2, 1, 0).
    For smooth pressures inside the fluid it is the most accurate; it needs particle shifting, and on a ragged free
    surface it extrapolates boldly.
    """

    ids: ClassVar = ("B9",)
    reference: ClassVar = "duan2019"
    order: ClassVar = 2
    needs: ClassVar = (GRADIENT_VECTORS, FIT_DEGREE)

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs,
        phi: str = "pressure", out: str = "pressure_gradient", over: int = ANY, view: PairView | None = None,
        dt: float = 0.0, moved: bool = True,
    ) -> None:  # fmt: skip
        """Write the gradient of ``phi`` at fluid rows into ``out``."""
        second_order_vectors(self, lattice, particles, pairs, inverse_square=True, gradient=True, over=over, rows=FLUID)
        pair_sum(
            difference, particles, pairs, out=out, weight=self.weight, re=self.radius(lattice), over=over,
            arguments=(1.0 / (self.n0(lattice) * lattice.spacing), lattice.spacing), fields={"value": phi}, view=view,
        )  # fmt: skip
