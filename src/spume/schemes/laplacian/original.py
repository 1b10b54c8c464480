"""The Laplacian model of the original method."""

from typing import ClassVar

from spume import kernels
from spume.lattice import Lattice
from spume.schemes.laplacian.base import Laplacian, Terms


@kernels.func
def coefficient(a, b, r, w):  # type: ignore[no-untyped-def]
    return w


TERMS = Terms(coefficient)


class Original(Laplacian, name="original"):
    """<lap phi>_i = 2 d/(lambda n0) sum_j (phi_j - phi_i) W (Koshizuka & Oka 1996; review Eq. 5).

    Symmetric, with positive coefficients; exact for quadratics on the regular arrangement; on an irregular one even
    linear fields leave an error that does not vanish with l0.
    """

    ids: ClassVar[tuple[str, ...]] = ("A3", "C1")
    reference: ClassVar = "koshizuka1996"
    order: ClassVar = 0
    conserves: ClassVar = frozenset({"flux"})
    symmetric: ClassVar = True

    def terms(self) -> Terms:
        """Return c = W."""
        return TERMS

    def scale(self, lattice: Lattice) -> float:
        """Return 2 d/(lambda n0) [1/m^2]."""
        return 2.0 * lattice.dimension / (self.lambda_(lattice) * self.n0(lattice))
