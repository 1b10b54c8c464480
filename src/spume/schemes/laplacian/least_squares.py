"""The Laplacian of the least-squares MPS method."""

from typing import ClassVar

from pydantic import Field as Parameter

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs
from spume.particles import ANY, Field, Particles
from spume.schemes.laplacian.base import Laplacian, Terms
from spume.schemes.second_order import FIT_DEGREE, LAPLACIAN_VECTOR, basis, per_metre, second_order_vectors
from spume.schemes.weight.base import Weight
from spume.schemes.weight.quadratic import Quadratic


@kernels.func
def coefficient(a, b, r, w):  # type: ignore[no-untyped-def]
    return w * a.laplacian_vector.dot(basis(r, 1.0))


TERMS = Terms(coefficient, reads=("laplacian_vector",))


class LeastSquares(Laplacian, name="least-squares"):
    """<lap phi>_i = 2/(n0 l0^2) sum_j W (phi_j - phi_i) L_i . q_ij (LSMPS type A, Tamai & Koshizuka 2014).

    q are the monomials of r/l0 up to second degree, L the sum of the rows of [1/n0 sum_j W q (x) q]^-1 that belong to
    squares. Exact for quadratics on any arrangement. It differs from ``second-order`` in the weight of the fit, W
    instead of W/r^2, with W = (1 - r/re)^2 as its authors have it: bounded where particles nearly touch, and smooth at
    re, which gives quieter coefficients for a larger stencil. Not symmetric. Rows with too few neighbours take a
    Laplacian of the original form.
    """

    ids: ClassVar[tuple[str, ...]] = ("C6",)
    reference: ClassVar = "tamai2014"
    order: ClassVar = 2
    symmetric: ClassVar = False
    completes: ClassVar = True
    needs: ClassVar[tuple[Field, ...]] = (LAPLACIAN_VECTOR, FIT_DEGREE)

    weight: Weight = Quadratic()
    """Weight function W(r, re)."""
    re: float = Parameter(default=3.1, ge=1.9, le=6.0)
    """Effective radius as a multiple of the spacing l0 [1]."""

    def terms(self) -> Terms:
        """Return c = W L_i . q."""
        return TERMS

    def prepare(self, lattice: Lattice, particles: Particles, pairs: Pairs, over: int = ANY) -> None:
        """Write ``laplacian_vector`` of fluid and wall rows."""
        second_order_vectors(self, lattice, particles, pairs, inverse_square=False, laplacian=True, over=over)
        per_metre(lattice, particles)

    def scale(self, lattice: Lattice) -> float:
        """Return 2/(n0 l0^2) [1/m^2]."""
        return 2.0 / (self.n0(lattice) * lattice.spacing**2)
