"""Walls as layers of particles: one wall layer that carries pressure, dummy layers behind it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter
from scipy.spatial import cKDTree

from spume.geometry.grid import Grid
from spume.geometry.shapes import Shape


@dataclass(frozen=True)
class Layers:
    """Rows of a wall.

    Attributes:
        position: cell centres [m], shape (n, d).
        wall: True for the first layer, False for the dummies behind it, shape (n,).
        to_surface: vector [m] from the row to the nearest point of the wetted surface, shape (n, d).
        master: for a dummy the index of the wall row that it copies, for a wall row its own, shape (n,).
    """

    position: NDArray[np.float64]
    wall: NDArray[np.bool_]
    to_surface: NDArray[np.float64]
    master: NDArray[np.int64]


def wall_layers(shape: Shape, grid: Grid, layers: int, *, wetted: str) -> Layers:
    """Return the rows of a wall whose fluid is on the ``"inside"`` or ``"outside"`` of a shape.

    The wall layer holds the solid cells whose centres are nearer than one spacing to the wetted
    surface, the diagonal cell of a corner included; the dummies are the solid cells behind it up to
    `layers` cells from the fluid. At an open face of a tank nothing stands beyond the face.
    """
    lower, upper = shape.bounds()
    first, last = grid.window(lower, upper, margin=layers)
    size = tuple(int(n) for n in last - first)
    depth = np.empty(size, dtype=np.float32).reshape(-1)  # distance behind the surface, positive in the solid
    allowed = np.empty(depth.size, dtype=bool)
    start = 0
    for cells in grid.blocks(first, last):
        points = grid.centres(cells)
        distance = shape.distance(points)
        part = slice(start, start + len(points))
        depth[part] = (distance if wetted == "inside" else -distance) / grid.spacing
        allowed[part] = shape.solid_side(points) if wetted == "inside" else True
        start += len(points)
    wet = (depth < -1e-6).reshape(size)
    near = maximum_filter(wet, size=2 * layers + 1, mode="nearest").reshape(-1)
    # The square neighbourhood gives a corner its full square, and a sloping surface too many layers.
    deepest = max(1.0, math.sqrt(2.0) * (layers - 0.5) + 1e-3)
    rows = np.flatnonzero(near & allowed & ~wet.reshape(-1) & (depth < deepest))
    cells = np.stack(np.unravel_index(rows, size), axis=1).astype(np.int64) + first
    position = grid.centres(cells)
    to_surface = shape.nearest(position) - position
    wall = depth[rows] < 1.0 - 1e-6
    return Layers(position, wall, to_surface, masters(position, wall, to_surface))


def masters(
    position: NDArray[np.float64], wall: NDArray[np.bool_], to_surface: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Return for each row the index of the wall row that it copies: itself, or for a dummy the nearest.

    The search starts a quarter of the way to the surface, which decides ties along `to_surface`: the
    diagonal dummy of a corner finds the corner's wall row, one of a convex edge the row of its own face.
    """
    result = np.arange(len(position))
    wall_rows = np.flatnonzero(wall)
    dummies = np.flatnonzero(~wall)
    if len(wall_rows) and len(dummies):
        _, found = cKDTree(position[wall_rows]).query(position[dummies] + 0.25 * to_surface[dummies])
        result[dummies] = wall_rows[found]
    return result
