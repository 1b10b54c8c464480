"""The Laplacian as the divergence of the pairs' own gradients."""

from typing import ClassVar

from spume import kernels
from spume.lattice import Lattice
from spume.schemes.laplacian.base import Laplacian, Terms


@kernels.func
def coefficient(a, b, r, w):  # type: ignore[no-untyped-def]
    return w / r.dot(r)


TERMS = Terms(coefficient)


class Distance(Laplacian, name="distance"):
    """<lap phi>_i = 2 d/n0 sum_j (phi_j - phi_i)/r^2 W (the sum of review Eq. 25, Liu 2018).

    Symmetric, with positive coefficients; exact for quadratics on the regular arrangement, like the original. Its
    coefficient grows with nearness as the pair terms of divergence and gradient do: where two particles nearly touch,
    the original one (lambda in place of r^2) lets a projection overshoot by lambda/r^2, this one does not.
    """

    reference: ClassVar = "liu2018"
    order: ClassVar = 0
    conserves: ClassVar = frozenset({"flux"})
    symmetric: ClassVar = True

    def terms(self) -> Terms:
        """Return c = W/r^2."""
        return TERMS

    def scale(self, lattice: Lattice) -> float:
        """Return 2 d/n0 [1]."""
        return 2.0 * lattice.dimension / self.n0(lattice)
