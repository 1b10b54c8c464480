"""The corrected gradient with a dummy neighbour that makes the surroundings of a row even."""

from typing import Any, ClassVar

from pydantic import Field as Parameter

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, PairView, RowTerm, pair_sum, pair_term, row_map
from spume.particles import ANY, Field, Particles
from spume.schemes.correction import CORRECTION, inverse_or_identity
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.gradient.base import Gradient

ASYMMETRY = Field("asymmetry", ("d",), "1/m", "sum of W r/r^2 over the neighbours: from empty to crowded places")


@pair_term(shape=("d",))
def offset(a, b, r, w):  # type: ignore[no-untyped-def]
    return w / r.dot(r) * r


@pair_term(shape=("d", "d"))
def moment(a, b, r, w):  # type: ignore[no-untyped-def]
    return r.outer_product(r) * (w / r.dot(r))


@pair_term(reads=("value",), shape=("d",))
def difference(a, b, r, w):  # type: ignore[no-untyped-def]
    return (b.value - a.value) * w / r.dot(r) * r


@kernels.cached
def _with_dummy(weight: Any) -> RowTerm:
    """Return the row term that adds the dummy neighbour, for a weight function."""
    bisections = 40

    @kernels.func
    def distance(size, re):  # type: ignore[no-untyped-def]
        """Return r with W(r)/r = size: W/r falls from infinity to 0 at re."""
        near = re * 0.0
        far = re
        for _ in range(bisections):
            middle = 0.5 * (near + far)
            if weight(middle, re) > size * middle:
                near = middle
            else:
                far = middle
        return 0.5 * (near + far)

    @kernels.func
    def completed(a, scale, re, limit):  # type: ignore[no-untyped-def]
        size = a.asymmetry.norm()
        outward = -a.asymmetry.normalized(1e-30)
        # W/r^2 r (x) r of the dummy; its weight is size r, for W/r = size.
        dummy = size * distance(size, re) * outward.outer_product(outward)
        inside = (1.0 - a.surface_share) * scale * (dummy @ a.difference)
        # In the open the dummy has pressure 0, P_d - P_i = -P_i.
        outside = -a.surface_share * a.value * size * outward
        inverse = inverse_or_identity((a.correction + dummy) * scale, limit)
        return inverse @ (a.difference + inside + outside) * scale

    return RowTerm(completed, ("correction", "asymmetry", "difference", "value", "surface_share"))


class DummyNeighbour(Gradient, name="dummy-neighbour"):
    """<grad P>_i = d/n0 C~_i [sum_j (P_j - P_i)/r^2 r_ij W + (P_d - P_i)/r_d^2 r_d W_d] (Liu 2018; review Eqs. 16, 17).

    C~_i = [d/n0 (sum_j W r (x) r/r^2 + W_d r_d (x) r_d/r_d^2)]^-1. The dummy stands where it makes the surroundings
    even, sum_j r_ij/r^2 W + r_d/r_d^2 W_d = 0: opposite to the crowd, at the distance where W(r_d)/r_d is the length
    of the sum over the neighbours. With it the reference value drops out of the sum, P_i or the smallest P alike,
    and with it the artificial repulsion. Its pressure is extrapolated with the original gradient, P_d = P_i +
    r_d . grad P; in the share theta of a row that belongs to the free surface it stands in the open, where P_d = 0.
    (How Liu et al. choose r_d and P_d is not in the review: these are the choices that do what they ask of a dummy.
    Extrapolating with the corrected gradient would give that gradient again.)

    Constants are exact on any arrangement, linear fields up to the square of the disorder. Steadier than the
    corrected gradient where neighbours are few: the matrix sees the dummy. Conserves no momentum.
    """

    ids: ClassVar = ("B8",)
    reference: ClassVar = "liu2018"
    order: ClassVar = 0
    needs: ClassVar = (CORRECTION, SURFACE_SHARE, ASYMMETRY)
    completes: ClassVar = True

    largest_condition: float = Parameter(default=1e3, gt=1.0)
    """Largest condition number of the matrix; above it a row falls back to C = I [1]."""

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs,
        phi: str = "pressure", out: str = "pressure_gradient", over: int = ANY, view: PairView | None = None,
        dt: float = 0.0, moved: bool = True,
    ) -> None:  # fmt: skip
        """Write the gradient of ``phi`` at fluid rows into ``out``."""
        pair_sum(
            (difference, moment, offset), particles, pairs, out=(out, "correction", "asymmetry"), weight=self.weight,
            re=self.radius(lattice), over=over, fields={"value": phi}, view=view,
        )  # fmt: skip
        row_map(
            _with_dummy(self.weight.function()), particles, out=out, fields={"value": phi, "difference": out},
            arguments=(lattice.dimension / self.n0(lattice), self.radius(lattice), self.largest_condition),
        )  # fmt: skip
