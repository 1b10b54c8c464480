"""Where a row's neighbours are: the vector from empty to crowded places."""

import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume.lattice import Lattice
from spume.pairs import Pairs, PairSum, pair_sums, pair_term
from spume.particles import FLUID, Field, Particles
from spume.schemes.operator import Operator

CROWDING = Field("crowding", ("d",), "1/m", "d/n0 sum of W r/r^2: points to where the neighbours are")


TENSILE_POWER = 4.0
"""Power of W/W(l0) in the term against clumps (Lind 2012)."""


def _scaled(a, total, scale):  # type: ignore[no-untyped-def]
    return scale * total


@pair_term(shape=("d",), finish=_scaled)
def towards_neighbours(a, b, r, w, scale):  # type: ignore[no-untyped-def]
    return w / r.dot(r) * r


def crowding_sum(operator: Operator, lattice: Lattice) -> PairSum:
    """Return the sum that `crowding_vector` makes."""
    scale = lattice.dimension / operator.n0(lattice)
    return PairSum(
        (towards_neighbours,), ("crowding",), operator.weight, operator.radius(lattice), FLUID, arguments=(scale,)
    )


def crowding_vector(operator: Operator, lattice: Lattice, particles: Particles, pairs: Pairs) -> None:
    """Write ``crowding`` = d/n0 sum_j W r_ij/r^2 [1/m] of fluid rows, over rows of every kind.

    It vanishes on the regular arrangement; on a flat surface of it its length is 0.492/l0 in 2D and 0.495/l0 in 3D
    (re = 2.1 l0).
    """
    pair_sums((crowding_sum(operator, lattice),), particles, pairs)


def half_lattice(
    weight: Any, re: float, dimension: int, stretch: float = 1.0
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Return the neighbours of a row on the flat surface of the lattice, in multiples of l0.

    Args:
        weight: weight function; re: effective radius [l0].
        stretch: factor along the normal (the last axis), at constant volume.

    Returns:
        vectors to them, shape (m, d), their lengths, shape (m,), and d/n0 of the lattice.
    """
    reach = int(np.ceil(1.5 * re))
    offsets = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * dimension, indexing="ij"), -1)
    offsets = offsets.reshape(-1, dimension).astype(float)
    whole = np.linalg.norm(offsets, axis=1)
    n0 = float(weight.values(whole[(whole > 0.0) & (whole < re)], re).sum())
    across = stretch ** (-1.0 / (dimension - 1))
    offsets = offsets * np.array([across] * (dimension - 1) + [stretch])
    r = np.linalg.norm(offsets, axis=1)
    kept = (r > 0.0) & (r < re) & (offsets[:, -1] <= 0.0)
    return offsets[kept], r[kept], dimension / n0


@functools.cache
def flat_surface_gradient(weight: Any, re: float, dimension: int, tensile: float) -> float:
    """Return l0 n . grad C of a row on the flat surface of the lattice, n outward [1]; it is negative."""
    offsets, r, scale = half_lattice(weight, re, dimension)
    w = weight.values(r, re)
    w = w * (1.0 + tensile * (w / float(weight.values(1.0, re))) ** TENSILE_POWER)
    return float(scale * (w * offsets[:, -1] / r**2).sum())
