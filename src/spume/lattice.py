"""Reference sums of the regular arrangement: n0 and lambda of a weight function."""

import functools
from dataclasses import dataclass
from math import pi
from typing import Any

import numpy as np


def regular_neighbours(reach: float, dimension: int) -> float:
    """Return about how many neighbours a row of the regular arrangement has within ``reach`` spacings."""
    return pi * reach**2 if dimension == 2 else 4.2 * reach**3


def corner_neighbours(reach: float, dimension: int) -> int:
    """Return how many neighbours within ``reach`` spacings a row has in the corner of a block of the arrangement."""
    along = np.arange(int(reach) + 1)
    distance = np.linalg.norm(np.stack(np.meshgrid(*[along] * dimension), axis=-1), axis=-1)
    return int(np.count_nonzero(distance < reach)) - 1


@dataclass(frozen=True)
class Lattice:
    """The square or cubic arrangement on which a calculation starts.

    Attributes:
        dimension: 2 or 3.
        spacing: l0 [m].
    """

    dimension: int
    spacing: float

    def n0(self, weight: Any, re: float) -> float:
        """Return the particle number density of a row inside the full arrangement [1].

        Koshizuka & Oka 1996: n0 = sum_j W(r_j, re), with the same re as the sum it normalises.

        Args:
            weight: a ``Weight`` scheme.
            re: effective radius as a multiple of l0.
        """
        return _sums(weight, re, self.dimension)[0]

    def missing(self, weight: Any, re: float) -> float:
        """Return the share of n0 that a row on the flat surface of the arrangement misses [1].

        Args:
            weight: a ``Weight`` scheme.
            re: effective radius as a multiple of l0.
        """
        level = _sums(weight, re, self.dimension - 1)[0]
        return 0.5 * (1.0 - level / self.n0(weight, re))

    def lambda_(self, weight: Any, re: float) -> float:
        """Return lambda = sum_j r_j^2 W / sum_j W of the full arrangement [m^2] (Koshizuka & Oka 1996).

        Args:
            weight: a ``Weight`` scheme.
            re: effective radius as a multiple of l0.
        """
        n0, second, _ = _sums(weight, re, self.dimension)
        return second / n0 * self.spacing**2

    def fourth(self, weight: Any, re: float) -> float:
        """Return sum_j r_j^4 W / sum_j W of the full arrangement [m^4]."""
        n0, _, fourth = _sums(weight, re, self.dimension)
        return fourth / n0 * self.spacing**4


@functools.cache
def _sums(weight: Any, re: float, dimension: int) -> tuple[float, float, float]:
    reach = int(np.ceil(re))
    axis = np.arange(-reach, reach + 1)
    squares = np.sum([a.astype(float) ** 2 for a in np.meshgrid(*[axis] * dimension)], axis=0)
    r = np.sqrt(squares[(squares > 0) & (squares < re * re)])
    w = weight.values(r, re)
    return float(w.sum()), float((w * r**2).sum()), float((w * r**4).sum())
