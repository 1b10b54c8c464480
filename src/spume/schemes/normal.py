"""The normal of the free surface from the positions of a row's neighbours."""

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, pair_sum, pair_term, row_map, row_term
from spume.particles import ANY, FLUID, Field, Particles
from spume.schemes.operator import Operator

NORMAL_FIELDS = (
    Field("surface_normal", ("d",), "1", "unit normal of the free surface, out of the fluid"),
    Field("neighbour_spread", ("d", "d"), "1", "inverse of the second moment of a row's neighbours", scratch="normal"),
)


@kernels.func
def softened(r, re):  # type: ignore[no-untyped-def]
    """Return (1 - |r|/re)^2: unlike an MPS weight it does not let the nearest neighbour decide."""
    rest = 1.0 - r.norm() / re
    return rest * rest


def _inverse_or_nothing(a, total, re):  # type: ignore[no-untyped-def]
    size = total.trace() / total.n
    result = total * 0.0
    for k in kernels.static(range(total.n)):
        result[k, k] = 1.0
    # Neighbours in one line or plane leave a direction undetermined.
    if abs((total / kernels.qd.max(size, 1e-12)).determinant()) > 1e-3:
        result = total.inverse()
    return result


@pair_term(shape=("d",))
def neighbour_mean(a, b, r, w, re):  # type: ignore[no-untyped-def]
    return softened(r, re) * r / re


@pair_term(shape=("d", "d"), finish=_inverse_or_nothing)
def neighbour_moment(a, b, r, w, re):  # type: ignore[no-untyped-def]
    return softened(r, re) * r.outer_product(r) / (re * re)


@row_term(reads=("surface_normal", "neighbour_spread"))
def outward(a):  # type: ignore[no-untyped-def]
    n = a.neighbour_spread @ a.surface_normal
    return -n / kernels.qd.max(n.norm(), 1e-12)


def surface_normals(
    operator: Operator, lattice: Lattice, particles: Particles, pairs: Pairs, rows: int = FLUID, over: int = ANY,
    where: str = "",
) -> None:  # fmt: skip
    """Write ``surface_normal``, n = -B^-1 b/|B^-1 b|.

    b = sum_j v r_ij, B = sum_j v r_ij (x) r_ij, v = (1 - r/re)^2:
    the renormalised normal of Khayyer 2017 and Marrone 2010, with a bounded weight in place of W/r^2: with
    W/r^2 a surface row that is displaced by 0.2 l0 along a flat surface sees it inclined by 45 degrees, so by 7.
    Inside the fluid its direction means nothing; ``where`` names a field that is positive at the rows that want one.
    """
    re = operator.radius(lattice)
    pair_sum(
        (neighbour_mean, neighbour_moment), particles, pairs, out=("surface_normal", "neighbour_spread"),
        weight=operator.weight, re=re, rows=rows, over=over, arguments=(re,), where=where,
    )  # fmt: skip
    row_map(outward, particles, out="surface_normal", rows=rows, where=where)
