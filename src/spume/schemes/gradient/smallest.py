"""The smallest value of a row and its neighbours, which repulsive gradient models subtract."""

from spume.lattice import Lattice
from spume.pairs import Pairs, PairView, pair_min, pair_term
from spume.particles import FLUID, WALL, Field, Particles
from spume.schemes.operator import Operator

SMALLEST_VALUE = Field("smallest_value", (), "Pa", "smallest pressure of a row and its neighbours")


def _or_own(a, smallest):  # type: ignore[no-untyped-def]
    return min(a.value, smallest)


@pair_term(reads=("value",), finish=_or_own)
def neighbour_value(a, b, r, w):  # type: ignore[no-untyped-def]
    return b.value


def find_smallest(
    operator: Operator, lattice: Lattice, particles: Particles, pairs: Pairs, phi: str, over: int, view: PairView | None
) -> None:
    """Write ``smallest_value`` of fluid rows, over themselves and their neighbours; dummies are no candidates."""
    pair_min(
        neighbour_value, particles, pairs, out="smallest_value", weight=operator.weight, re=operator.radius(lattice),
        over=over & (FLUID | WALL), fields={"value": phi}, view=view,
    )  # fmt: skip
