"""Free surface where n is low and the neighbours lie on one side."""

import functools
from typing import Any, ClassVar

import numpy as np
from pydantic import Field as Parameter

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, pair_sum, pair_term, row_map, row_term
from spume.particles import ANY, FLUID, WALL, Field, Particles
from spume.schemes.free_surface.base import SURFACE_SHARE, FreeSurface, as_share


@pair_term(shape=("d",))
def offset(a, b, r, w):  # type: ignore[no-untyped-def]
    return r


@row_term(reads=("number_density", "neighbour_offset"))
def low_and_one_sided(a, density, distance):  # type: ignore[no-untyped-def]
    one_sided = a.neighbour_offset.norm() > distance or a.number_density < 0.5 * density
    return kernels.qd.cast(a.number_density < density and one_sided, kernels.i32)


class Asymmetry(FreeSurface, name="asymmetry"):
    """A row is on the free surface if n < beta n0 and |sum_j r_ij| > alpha S0 (Khayyer, Gotoh & Shao 2009).

    The sum over all neighbours nearer than re is not weighted; S0 is its length on the flat surface of the lattice,
    3 l0 in 2D and 9 l0 in 3D at re = 1.85 l0. The paper tests the components of the sum one by one against l0, which
    depends on the axes. A row with n < beta n0/2 is on the surface whatever the sum: a thread or a lone row has
    none. Rejects rows that lack neighbours on all sides; in strong disorder the sum itself is disordered.
    """

    ids: ClassVar = ("E3",)
    reference: ClassVar = "khayyer2009a"
    unused: ClassVar = {"weight": "every neighbour nearer than re counts alike"}
    needs: ClassVar = (SURFACE_SHARE, Field("neighbour_offset", ("d",), "m", "sum of r over the neighbours of a row"))

    beta: float = Parameter(default=0.97, gt=0.5, le=1.0)
    """Fraction of n0 below which a row may be on the surface [1]."""
    re: float = Parameter(default=1.85, ge=1.1, le=6.0)
    """Effective radius of the sum as a multiple of l0, between two shells of the lattice [1]."""
    alpha: float = Parameter(default=0.4, gt=0.0, lt=1.0)
    """Length of the sum above which it is, as a part of S0 [1]."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any) -> None:
        """Write ``free_surface`` (1 or 0) and ``surface_share`` of fluid and wall rows."""
        distance = self.alpha * flat_sum(self.re, lattice.dimension) * lattice.spacing
        pair_sum(
            offset, particles, pairs, out="neighbour_offset", weight=self.weight, re=self.radius(lattice),
            rows=FLUID | WALL, over=ANY,
        )  # fmt: skip
        row_map(
            low_and_one_sided, particles, out="free_surface", rows=FLUID | WALL,
            arguments=(self.beta * number_density.n0(lattice), distance),
        )  # fmt: skip
        row_map(as_share, particles, out="surface_share", rows=FLUID | WALL)


@functools.cache
def flat_sum(re: float, dimension: int) -> float:
    """Return S0/l0, the length of the sum of a row on the flat surface of the lattice [1]."""
    reach = int(np.ceil(re))
    offsets = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * dimension), -1).reshape(-1, dimension)
    below = ((offsets**2).sum(axis=1) < re * re) & (offsets[:, -1] < 0)
    return float(-offsets[below, -1].sum())
