"""The higher-order Laplacian: the divergence of the gradient's own kernel sum."""

from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import model_validator

from spume import kernels
from spume.lattice import Lattice
from spume.schemes.laplacian.base import Laplacian, Terms
from spume.schemes.operator import Operator
from spume.schemes.weight.inverse import Inverse


@kernels.func
def coefficient(a, b, r, w):  # type: ignore[no-untyped-def]
    # W = re/r - 1, so this is re/r^3.
    return (w + 1.0) / r.dot(r)


TERMS = Terms(coefficient)


class _Reciprocal:
    """W + 1 = re/r, to be summed over the lattice."""

    def values(self, r: Any, re: float) -> Any:
        return re / np.asarray(r)


_RECIPROCAL = _Reciprocal()


class HigherOrder(Laplacian, name="higher-order"):
    """<lap phi>_i = c/n0 sum_j (phi_j - phi_i) re/r^3, from the derivatives of W = re/r - 1.

    Published are W'' - W'/r in 2D, thus c = 3 (Khayyer & Gotoh 2010; review Eq. 21), and W'' in 3D, thus c = 2
    (Khayyer & Gotoh 2012; review Eq. 22). For phi = |x|^2 and many neighbours the sum is c d, so that c = 2 is
    consistent in both, and the 2D form gives 3/2 of the Laplacian. At finite re the sum over the regular arrangement
    differs from that limit (by 1.42 in 2D and 1.07 in 3D at re = 2.1 l0), and so does the source of the same authors
    (dn/dt from W'), by the same factor: ``consistent`` with such a source and the same re, ``calibrated`` with a source
    that has the right size by itself. ``published`` with such a source gives 2/3 of the projection's pressure in 2D.

    Symmetric, with positive coefficients. A nearer neighbour counts more than in the original model, which makes the
    pressure less noisy. For the weight ``inverse`` only, for which it is derived.
    """

    ids: ClassVar[tuple[str, ...]] = ("C2", "C3")
    reference: ClassVar = ("khayyer2010", "khayyer2012")
    order: ClassVar = 0
    conserves: ClassVar = frozenset({"flux"})
    symmetric: ClassVar = True

    form: Literal["published", "consistent", "calibrated"] = "calibrated"
    """``published``: c = 3 in 2D, 2 in 3D; ``consistent``: c = 2; ``calibrated``: exact on the regular arrangement."""

    @model_validator(mode="after")
    def _derived_for_one_weight(self) -> Self:
        if not isinstance(self.weight, Inverse):
            raise ValueError(
                f"laplacian 'higher-order' is derived from the weight 'inverse', not {self.weight.key!r}: "
                'choose weight = "inverse", or the laplacian distance'
            )
        return self

    def caution(self, of_slope: bool, number_density: Operator, of_crowding: bool = False) -> str:
        """Return what does not fit about a source of the pressure equation and this model, or nothing."""
        if of_slope:
            return self._caution_of_slope(number_density)
        if of_crowding:  # a small change of n has the factor of "consistent", the volume that n states has not
            both = f'the form "{self.form}" of the laplacian is too large for it: choose "calibrated" or "consistent"'
            return both if self.form == "published" else ""
        if self.form != "calibrated":
            return f'has the right size by itself, the form "{self.form}" of the laplacian has not: choose "calibrated"'
        return ""

    def _caution_of_slope(self, number_density: Operator) -> str:
        """Return what does not fit about a source that sums the derivative of the weight of ``number_density``."""
        if self.form != "consistent":
            size = 'the pressure is 2/3 of the projection\'s in 2D with "published" (in 3D it is the same form): '
            size = size if self.form == "published" else ""
            return f'carries the factor of the form "consistent" of the laplacian higher-order: {size}choose that form'
        summed = number_density.weight.key
        if summed != self.weight.key:
            factor = "with another weight than the laplacian higher-order, so that the factors of both differ"
            return f'is summed {factor}: choose "{self.weight.key}" for number_density, not "{summed}"'
        if number_density.re != self.re:
            both = f"re = {number_density.re:g}, the laplacian higher-order with re = {self.re:g}"
            return f"is summed with {both}: choose the same"
        return ""

    def terms(self) -> Terms:
        """Return c = re/r^3."""
        return TERMS

    def scale(self, lattice: Lattice) -> float:
        """Return c/n0 [1]."""
        if self.form == "calibrated":
            return 2.0 * lattice.dimension / lattice.n0(_RECIPROCAL, self.re)
        published = 3.0 if lattice.dimension == 2 else 2.0
        return (published if self.form == "published" else 2.0) / self.n0(lattice)
