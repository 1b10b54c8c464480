"""Free surface where the divergence of the position is small."""

import functools
from typing import Any, ClassVar

import numpy as np
from pydantic import Field as Parameter

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, pair_sum, pair_term, row_map, row_term
from spume.particles import ANY, FLUID, WALL, Field, Particles
from spume.schemes.free_surface.base import SURFACE_SHARE, FreeSurface, as_share
from spume.schemes.operator import Operator

POSITION_DIVERGENCE = Field("position_divergence", (), "1", "divergence of the position, d inside the fluid")
LIMITS = {2: 1.6, 3: 2.55}
"""Divergence of the position below which a row is on the surface, by dimension."""


def _scaled(a, total, re, scale):  # type: ignore[no-untyped-def]
    return scale * total


@pair_term(finish=_scaled)
def spreading(a, b, r, w, re, scale):  # type: ignore[no-untyped-def]
    # r . grad K of Wendland's K = (1 - q)^4 (1 + 4 q), without its constants.
    q = r.norm() / re
    return q * q * (1.0 - q) ** 3


@functools.cache
def _on_lattice(re: float, dimension: int) -> float:
    reach = int(np.ceil(re))
    squares = np.sum(np.stack(np.meshgrid(*[np.arange(-reach, reach + 1.0) ** 2] * dimension)), axis=0)
    q = np.sqrt(squares[squares < re * re]) / re
    return float((q**2 * (1.0 - q) ** 3).sum())


def position_divergence(operator: Operator, lattice: Lattice, particles: Particles, pairs: Pairs) -> None:
    """Write ``position_divergence`` of fluid and wall rows, summed over rows of every kind."""
    pair_sum(
        spreading, particles, pairs, out="position_divergence", weight=operator.weight, re=operator.radius(lattice),
        rows=FLUID | WALL, over=ANY,
        arguments=(operator.radius(lattice), lattice.dimension / _on_lattice(operator.re, lattice.dimension)),
    )  # fmt: skip


@row_term(reads=("position_divergence",))
def below(a, limit):  # type: ignore[no-untyped-def]
    return kernels.qd.cast(a.position_divergence < limit, kernels.i32)


class DivergenceOfPosition(FreeSurface, name="divergence-of-position"):
    """A row is on the free surface if div r < 1.6 in 2D, 2.55 in 3D, where d is the value inside (Lee 2008).

    div r_i = sum_j V_j r_ij . grad K = d/s0 sum_j q^2 (1 - q)^3, q = r/re, with s0 the same sum on the lattice:
    the divergence with Wendland's kernel K of support re. With the MPS divergence model it would be d n_i/n0,
    the detection by number density under another name; the kernel's gradient vanishes for near pairs, so clumps
    do not raise it. Lee's limits are 1.5 and 2.4; with this kernel the row in the corner of surface and wall
    has 1.50 and would be missed. Cheap, and quieter in a disordered fluid than the number density.
    """

    ids: ClassVar = ("E2",)
    reference: ClassVar = "lee2008"
    unused: ClassVar = {"weight": "its kernel is Wendland's"}
    needs: ClassVar = (SURFACE_SHARE, POSITION_DIVERGENCE)

    limit: float | None = Parameter(default=None, gt=0.0, le=3.0)
    """Divergence below which a row is on the surface; default 1.6 in 2D, 2.55 in 3D [1]."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any) -> None:
        """Write ``free_surface`` (1 or 0) and ``surface_share`` of fluid and wall rows."""
        position_divergence(self, lattice, particles, pairs)
        limit = LIMITS[lattice.dimension] if self.limit is None else self.limit
        row_map(below, particles, out="free_surface", rows=FLUID | WALL, arguments=(limit,))
        row_map(as_share, particles, out="surface_share", rows=FLUID | WALL)
