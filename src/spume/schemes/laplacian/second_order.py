"""The Laplacian of the second-order corrective matrix."""

from typing import ClassVar

from pydantic import Field as Parameter

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs
from spume.particles import ANY, Field, Particles
from spume.schemes.laplacian.base import Laplacian, Terms
from spume.schemes.second_order import FIT_DEGREE, LAPLACIAN_VECTOR, basis, per_metre, second_order_vectors


@kernels.func
def coefficient(a, b, r, w):  # type: ignore[no-untyped-def]
    return w / r.dot(r) * a.laplacian_vector.dot(basis(r, 1.0))


TERMS = Terms(coefficient, reads=("laplacian_vector",))


class SecondOrder(Laplacian, name="second-order"):
    """<lap phi>_i = 2/n0 sum_j W (phi_j - phi_i) (C_3 + C_4) . p_ij/(l0 r) (SCM, Duan et al. 2019; review Eq. 26).

    C_k are rows of the inverse of 1/n0 sum_j W p (x) p, p = (x/r, y/r, x^2/(l0 r), y^2/(l0 r), xy/(l0 r)); in 3D
    there are nine monomials and C_4 + C_5 + C_6. Exact for quadratics on any arrangement, so its error falls with l0.
    Not symmetric; some coefficients may be negative. A row whose neighbours do not determine the second derivatives
    (field ``fit_degree`` < 2: spray, thin sheets) takes the original model. For accuracy on disordered arrangements,
    above all in viscosity.
    """

    ids: ClassVar[tuple[str, ...]] = ("C6",)
    reference: ClassVar = "duan2019"
    order: ClassVar = 2
    symmetric: ClassVar = False
    completes: ClassVar = True
    needs: ClassVar[tuple[Field, ...]] = (LAPLACIAN_VECTOR, FIT_DEGREE)

    re: float = Parameter(default=3.1, ge=1.9, le=6.0)
    """Effective radius as a multiple of the spacing l0 [1]."""

    def terms(self) -> Terms:
        """Return c = W/r^2 L_i . q."""
        return TERMS

    def prepare(self, lattice: Lattice, particles: Particles, pairs: Pairs, over: int = ANY) -> None:
        """Write ``laplacian_vector`` of fluid and wall rows."""
        second_order_vectors(self, lattice, particles, pairs, inverse_square=True, laplacian=True, over=over)
        per_metre(lattice, particles)

    def scale(self, lattice: Lattice) -> float:
        """Return 2/n0 [1]."""
        return 2.0 / self.n0(lattice)
