"""The common lattice of a case: cells that all its shapes are filled on."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from spume.geometry.shapes import Shape

CHUNK = 1 << 20
"""Points handled at once, so that filling a large shape needs little memory beyond its result."""
_LARGEST_INDEX = 1e9
_SPARSEST = 10  # cells searched per particle that memory holds


class TooManyCellsError(ValueError):
    """A shape that would have to be searched on more cells than memory can hold."""


@dataclass(frozen=True)
class Grid:
    """Square cells of size `spacing` [m]; particles sit at ``origin + (i + 1/2) spacing``.

    Fluids and walls of a case share one grid, so that the first wall layer stands exactly one
    spacing from the fluid beside it, and a wall plane half a spacing from either.
    """

    origin: tuple[float, ...]
    spacing: float
    largest: int = 100_000_000
    """Largest number of particles that one shape may get."""

    @property
    def dimension(self) -> int:
        """Number of axes."""
        return len(self.origin)

    def snap(self, x: float, axis: int, what: str, said: list[str]) -> float:
        """Return the cell face nearest to the coordinate x [m]; half-way goes up.

        Appends a sentence to `said` where the face is off by more than 1 % of the spacing.
        """
        cells = (x - self.origin[axis]) / self.spacing
        face = math.floor(cells + 0.5 + 1e-6)
        if abs(cells - face) < 1e-6:  # keep the number as written: 0.3, not 0.30000000000000004
            return x
        moved = self.origin[axis] + face * self.spacing
        if abs(cells - face) > 0.01:
            said.append(f"{what} = {x:g} m is no multiple of the spacing of {self.spacing:g} m: moved to {moved:g} m")
        return moved

    def cells(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the indices of the cells that hold the points, shape (n, d)."""
        return np.floor((points - np.array(self.origin)) / self.spacing + 1e-9).astype(np.int64)

    def centres(self, cells: NDArray[np.int64]) -> NDArray[np.float64]:
        """Return the centres [m] of cells, shape (n, d)."""
        return np.array(self.origin) + (cells + 0.5) * self.spacing

    def window(
        self, lower: NDArray[np.float64], upper: NDArray[np.float64], margin: int = 0
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Return first and past-the-last index, shape (d,), of the cells whose centres lie between two corners [m].

        Raises:
            TooManyCellsError: the window has more than `largest` cells.
        """
        origin = np.array(self.origin)
        extent = np.maximum(0.0, (upper - lower) / self.spacing) + 2 * margin
        if not np.all(extent < _LARGEST_INDEX):
            raise TooManyCellsError(f"it is {extent.max():.3g} cells of {self.spacing:g} m long")
        first = np.ceil((lower - origin) / self.spacing - 0.5 - 1e-9).astype(np.int64) - margin
        last = np.floor((upper - origin) / self.spacing - 0.5 + 1e-9).astype(np.int64) + 1 + margin
        return first, np.maximum(first, last)

    def blocks(self, first: NDArray[np.int64], last: NDArray[np.int64]) -> Iterator[NDArray[np.int64]]:
        """Yield the cells of a window in order (last axis fastest), some at a time, each of shape (m, d).

        Raises:
            TooManyCellsError: so many that looking at each would take too long.
        """
        shape = tuple(int(n) for n in last - first)
        total = math.prod(shape)
        if total > _SPARSEST * self.largest:
            raise TooManyCellsError(
                f"it spans {total:.3g} cells of {self.spacing:g} m, this machine's memory holds "
                f"{self.largest:.3g} particles"
            )
        for start in range(0, total, CHUNK):
            flat = np.arange(start, min(start + CHUNK, total))
            yield np.stack(np.unravel_index(flat, shape), axis=1).astype(np.int64) + first


def fill(shape: Shape, grid: Grid) -> NDArray[np.float64]:
    """Return the cell centres [m] inside a shape, shape (n, d), ordered with the last axis fastest.

    A centre that lies on the surface to within 1e-9 of the spacing counts as outside.
    """
    lower, upper = shape.bounds()
    found = [np.empty((0, grid.dimension))]
    for cells in grid.blocks(*grid.window(lower, upper)):
        points = grid.centres(cells)
        found.append(points[shape.distance_within(points, 1e-3 * grid.spacing) < -1e-9 * grid.spacing])
    return np.concatenate(found)
