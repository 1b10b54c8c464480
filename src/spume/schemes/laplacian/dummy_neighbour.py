"""A Laplacian with one dummy neighbour, placed where neighbours are missing."""

from typing import Any, ClassVar

from pydantic import Field as Parameter

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, PairTerm, RowTerm, pair_sum, pair_term, row_map
from spume.particles import ANY, FLUID, WALL, Field, Particles
from spume.schemes.correction import CORRECTION, moment
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.laplacian.base import Laplacian, Terms

LACK = Field("lack", ("d",), "1/m", "d/n0 sum_j W r/r^2 over the neighbours, which the dummy neighbour balances")
INSIDE_VECTOR = Field("inside_vector", ("d",), "1/m", "vector by which a row's dummy neighbour follows its gradient")
OUTSIDE_WEIGHT = Field("outside_weight", (), "1/m^2", "W/r^2 of the dummy neighbour, where it stands for the air")


@kernels.func
def coefficient(a, b, r, w):  # type: ignore[no-untyped-def]
    return (1.0 - a.inside_vector.dot(r)) * w / r.dot(r)


@kernels.func
def diagonal(a):  # type: ignore[no-untyped-def]
    return a.outside_weight


TERMS = Terms(coefficient, reads=("inside_vector",), diagonal=diagonal, row_reads=("outside_weight",))


def _scaled(a, total, scale, limit):  # type: ignore[no-untyped-def]
    return scale * total


@pair_term(shape=("d",), finish=_scaled)
def lack(a, b, r, w, scale, limit):  # type: ignore[no-untyped-def]
    return w / r.dot(r) * r


def _inside(a):  # type: ignore[no-untyped-def]
    return (1.0 - a.surface_share) * (a.correction @ a.lack)


INSIDE = RowTerm(kernels.func(_inside), ("surface_share", "correction", "lack"))


@kernels.cached
def _outside(weight: Any) -> RowTerm:
    """Return the term that places the dummy neighbour: W(r)/r falls with r, so halving an interval finds it."""

    def outside(a, re, scale):  # type: ignore[no-untyped-def]
        size = a.lack.norm() / scale
        low = 1e-3 * re
        high = re
        for _ in range(40):
            middle = 0.5 * (low + high)
            if weight(middle, re) > size * middle:
                low = middle
            else:
                high = middle
        return a.surface_share * size / low

    return RowTerm(kernels.func(outside), ("lack", "surface_share"))


class DummyNeighbour(Laplacian, name="dummy-neighbour"):
    """<lap phi>_i = 2 d/n0 [sum_j (phi_j - phi_i)/r^2 W + (phi_d - phi_i)/r_d^2 W_d] (Liu et al. 2018; review Eq. 25).

    The dummy neighbour lies where it evens out the arrangement, sum_j W r_ij/r^2 + W_d r_d/r_d^2 = 0. Inside the fluid
    it has the value phi_i + r_d . <grad phi>_i of the corrected gradient, so linear fields are exact on any
    arrangement, as with the corrected vector of the same coefficient. On the free surface it stands for the air and
    has the surface's known value: the row is tied to it by W_d/r_d^2, and no further condition is needed. A row that
    belongs to the surface by the share theta takes both in proportion. Not symmetric.
    """

    ids: ClassVar[tuple[str, ...]] = ("C5",)
    reference: ClassVar = "liu2018"
    order: ClassVar = 1
    symmetric: ClassVar = False
    completes: ClassVar = True
    needs: ClassVar[tuple[Field, ...]] = (CORRECTION, SURFACE_SHARE, LACK, INSIDE_VECTOR, OUTSIDE_WEIGHT)

    largest_condition: float = Parameter(default=1e3, gt=1.0)
    """Largest condition number of the corrective matrix; above it a row falls back to C = I [1]."""

    def terms(self) -> Terms:
        """Return c = (1 - v_i . r) W/r^2 and the tie to the air."""
        return TERMS

    def prepare(self, lattice: Lattice, particles: Particles, pairs: Pairs, over: int = ANY) -> None:
        """Write ``inside_vector`` = (1 - theta) d/n0 C_i sum_j W r/r^2 and ``outside_weight`` = theta W_d/r_d^2."""
        scale = lattice.dimension / self.n0(lattice)
        terms: tuple[PairTerm, PairTerm] = (moment, lack)
        pair_sum(
            terms, particles, pairs, out=("correction", "lack"), weight=self.weight, re=self.radius(lattice), over=over,
            rows=FLUID | WALL, arguments=(scale, self.largest_condition),
        )  # fmt: skip
        row_map(INSIDE, particles, out="inside_vector", rows=FLUID | WALL)
        row_map(
            _outside(self.weight.function()), particles, out="outside_weight", rows=FLUID | WALL,
            arguments=(self.radius(lattice), scale),
        )  # fmt: skip

    def scale(self, lattice: Lattice) -> float:
        """Return 2 d/n0 [1]."""
        return 2.0 * lattice.dimension / self.n0(lattice)
