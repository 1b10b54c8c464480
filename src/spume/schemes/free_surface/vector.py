"""Free surface by a vector function of the neighbours' directions."""

import functools
from typing import Any, ClassVar

import numpy as np
from pydantic import Field as Parameter

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, pair_sum, pair_term, row_map, row_term
from spume.particles import ANY, FLUID, WALL, Field, Particles
from spume.schemes.free_surface.base import SURFACE_SHARE, FreeSurface, as_share


def _scaled(a, total, scale):  # type: ignore[no-untyped-def]
    return scale * total


@pair_term(shape=("d",), finish=_scaled)
def direction(a, b, r, w, scale):  # type: ignore[no-untyped-def]
    return w * r / r.norm()


@row_term(reads=("number_density", "direction_sum"))
def few_or_one_sided(a, few, many, limit):  # type: ignore[no-untyped-def]
    one_sided = a.number_density < many and a.direction_sum.norm() > limit
    return kernels.qd.cast(a.number_density < few or one_sided, kernels.i32)


class VectorFunction(FreeSurface, name="vector"):
    """A row is on the free surface if n < lower n0, or n < upper n0 and |F| > alpha |F|0 (Zhang 2014).

    F_i = d/n0 sum_j W r_ij/|r_ij|, and |F|0 is its length on the flat surface of the lattice. Weighted, unlike
    the sum of ``asymmetry``, so that no row counts or not as it crosses re. Between the two densities the
    direction decides, above upper n0 a row is inside. A good compromise of cost and certainty for sharp
    surfaces.
    """

    ids: ClassVar = ("E4",)
    reference: ClassVar = "zhang2014"
    needs: ClassVar = (
        SURFACE_SHARE,
        Field("direction_sum", ("d",), "1", "weighted sum of the directions of neighbours"),
    )

    lower: float = Parameter(default=0.8, gt=0.0, le=1.0)
    """Fraction of n0 below which a row is on the surface [1]."""
    upper: float = Parameter(default=0.97, gt=0.5, le=1.5)
    """Fraction of n0 above which it is not [1]."""
    alpha: float = Parameter(default=0.9, gt=0.0, le=2.0)
    """Fraction of |F|0 above which a row in between is on the surface [1]."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any) -> None:
        """Write ``free_surface`` (1 or 0) and ``surface_share`` of fluid and wall rows."""
        d, n0 = lattice.dimension, number_density.n0(lattice)
        pair_sum(
            direction, particles, pairs, out="direction_sum", weight=self.weight, re=self.radius(lattice),
            rows=FLUID | WALL, over=ANY, arguments=(d / self.n0(lattice),),
        )  # fmt: skip
        row_map(
            few_or_one_sided, particles, out="free_surface", rows=FLUID | WALL,
            arguments=(self.lower * n0, self.upper * n0, self.alpha * flat_length(self.weight, self.re, d)),
        )  # fmt: skip
        row_map(as_share, particles, out="surface_share", rows=FLUID | WALL)


@functools.cache
def flat_length(weight: Any, re: float, dimension: int) -> float:
    """Return |F|0, the length of F of a row on the flat surface of the lattice [1]."""
    reach = int(np.ceil(re))
    offsets = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1.0)] * dimension), -1).reshape(-1, dimension)
    r = np.linalg.norm(offsets, axis=1)
    near = (r > 0.0) & (r < re)
    offsets, r = offsets[near], r[near]
    w = weight.values(r, re)
    below = offsets[:, -1] <= 0.0
    return float(abs(dimension / w.sum() * (w * offsets[:, -1] / r)[below].sum()))
