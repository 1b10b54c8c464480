"""Walls as layers of particles: one wall layer that carries pressure, dummy layers behind it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from spume.geometry.grid import Grid, TooManyCellsError
from spume.geometry.shapes import Shape


@dataclass(frozen=True)
class Layers:
    """Rows of a wall.

    Attributes:
        position: cell centres [m], shape (n, d).
        wall: True for the first layer, False for the dummies behind it, shape (n,).
        to_surface: vector [m] from the row to the nearest point of the wetted surface, shape (n, d).
        exposed: faces of the row's cell beyond which its body has no row, as `exposed_faces` numbers them, shape (n,).
        master: for a dummy the index of the wall row that it copies, for a wall row its own, shape (n,).
    """

    position: NDArray[np.float64]
    wall: NDArray[np.bool_]
    to_surface: NDArray[np.float64]
    exposed: NDArray[np.int32]
    master: NDArray[np.int64]


def wall_layers(shape: Shape, grid: Grid, layers: int, *, wetted: str) -> Layers:
    """Return the rows of a wall whose fluid is on the ``"inside"`` or ``"outside"`` of a shape.

    The wall layer holds the solid cells whose centres are nearer than one spacing to the wetted
    surface, the diagonal cell of a corner included; the dummies are the solid cells behind it up to
    `layers` cells from the fluid. At an open face of a tank nothing stands beyond the face. The walls' own top, around
    an open upper face, is wet too: water that runs over the rim stands on it.

    Raises:
        TooManyCellsError: more cells than this machine's memory holds.
    """
    # The square neighbourhood gives a corner its full square, and a sloping surface too many layers: no
    # row is deeper than the last one on the diagonal of an edge (in 3D in the wall layer of a third wall).
    deepest = max(1.0, math.sqrt(2.0 * (layers - 0.5) ** 2 + 0.25 * (grid.dimension - 2)) + 1e-3)
    sign = 1.0 if wetted == "inside" else -1.0
    found, depths, total = [], [], 0
    for corner, size in _blocks_near_the_surface(shape, grid, layers):
        window = tuple(int(n) for n in size + 2 * layers)
        wide = np.moveaxis(np.indices(window), 0, -1).reshape(-1, grid.dimension)
        points = grid.centres(wide + corner - layers)
        # Behind the surface, positive in the solid.
        depth = sign * shape.distance_within(points, (deepest + 0.5) * grid.spacing) / grid.spacing
        wet = (depth < -1e-6).reshape(window)
        near = _widened(wet, layers).reshape(-1)
        rows = near & ~wet.reshape(-1) & (depth < deepest)
        rows &= np.all((wide >= layers) & (wide < size + layers), axis=1)
        if wetted == "inside":
            rows &= shape.solid_side(points)
        found.append((wide + corner - layers)[rows])
        depths.append(depth[rows])
        total += int(np.count_nonzero(rows))
        if total > grid.largest:
            raise TooManyCellsError(f"its layers have more than {grid.largest:.3g} particles")
    cells = np.concatenate([np.empty((0, grid.dimension), dtype=np.int64), *found])
    order = np.lexsort(cells.T[::-1])
    cells, depth = cells[order], np.concatenate([np.empty(0), *depths])[order]
    position = grid.centres(cells)
    to_surface = shape.nearest(position) - position
    rim = np.zeros(len(position), dtype=bool)
    if wetted == "inside":
        up = shape.below_rim(position)
        # What stands as near to the wetted face as to the rim belongs to the face.
        rim = up < np.linalg.norm(to_surface, axis=1) - 1e-6 * grid.spacing
        to_surface[rim] = 0.0
        to_surface[rim, -1] = up[rim]
        depth = np.where(rim, up / grid.spacing, depth)
    on = np.flatnonzero(np.abs(depth) < _ON)
    if len(on):
        to_surface[on] = _ON * grid.spacing * _into_the_fluid(shape, position[on], sign, grid.spacing)
    wall = depth < 1.0 - 1e-6
    return Layers(position, wall, to_surface, exposed_faces(cells), masters(position, wall, to_surface))


def exposed_faces(cells: NDArray[np.int64]) -> NDArray[np.int32]:
    """Return which faces of cells, shape (n, d), no other of them lies beyond, shape (n,).

    A sum over faces, 4^k for the lower and 2 4^k for the upper one of axis k. Together they are the surface of the
    cells, a closed one: their areas with their directions add up to nothing around a body.
    """
    lower = cells.min(axis=0, initial=0) - 1
    size = cells.max(axis=0, initial=0) - lower + 2
    numbers = np.ravel_multi_index(tuple((cells - lower).T), tuple(size))
    known = np.sort(numbers)
    strides = np.append(np.cumprod(size[:0:-1])[::-1], 1)
    found = np.zeros(len(cells), dtype=np.int32)
    for axis, stride in enumerate(strides):
        for upper, beyond in enumerate((numbers - stride, numbers + stride)):
            at = np.minimum(np.searchsorted(known, beyond), len(known) - 1)
            found += np.int32(4**axis << upper) * (known[at] != beyond)
    return found


_ON = 1e-4
"""Rows nearer to the surface than this part of the spacing get this distance from it, which keeps its direction."""


def _into_the_fluid(shape: Shape, points: NDArray[np.float64], sign: float, spacing: float) -> NDArray[np.float64]:
    """Return the unit normals that look into the fluid at points on a surface: the slope of the distance there."""
    slope = np.empty_like(points)
    for k, step in enumerate(1e-2 * spacing * np.eye(points.shape[1])):
        slope[:, k] = -sign * (shape.distance(points + step) - shape.distance(points - step))
    length = np.linalg.norm(slope, axis=1, keepdims=True)
    slope[length[:, 0] == 0.0, -1] = 1.0  # thinner than the step: there is no side to tell
    return slope / np.where(length == 0.0, 1.0, length)


def _widened(marked: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    """Return which cells have a marked one at most `reach` cells away along every axis."""
    for axis in range(marked.ndim):
        wide = marked.copy()
        along, into = np.moveaxis(marked, axis, 0), np.moveaxis(wide, axis, 0)
        for shift in range(1, reach + 1):
            into[shift:] |= along[:-shift]
            into[:-shift] |= along[shift:]
        marked = wide
    return marked


_EDGE = {2: 64, 3: 24}


def _blocks_near_the_surface(
    shape: Shape, grid: Grid, layers: int
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Yield first cell and size of those blocks of cells that the layers may touch.

    The distance from the surface changes by at most one metre a metre, so its value at the middle of
    a block rules out most blocks: a wall costs as much as its surface, not as the room that it encloses.
    """
    edge = _EDGE[grid.dimension]
    first, last = grid.window(*shape.bounds(), margin=layers)
    count = -(-(last - first) // edge)
    reach = (math.sqrt(grid.dimension) * (edge / 2 + layers) + 2.0) * grid.spacing
    for block in grid.blocks(np.zeros_like(count), count):
        corners = first + block * edge
        middle = np.array(grid.origin) + (corners + edge / 2) * grid.spacing
        for corner in corners[shape.gap(middle) < reach]:
            yield corner, np.minimum(edge, last - corner)


def masters(
    position: NDArray[np.float64], wall: NDArray[np.bool_], to_surface: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Return for each row the index of the wall row that it copies: itself, or for a dummy the nearest; shape (n,).

    The search starts a quarter of the way to the surface, which decides ties along `to_surface`: the
    diagonal dummy of a corner finds the corner's wall row, one of a convex edge the row of its own face.
    """
    result = np.arange(len(position))
    wall_rows = np.flatnonzero(wall)
    dummies = np.flatnonzero(~wall)
    if len(wall_rows) and len(dummies):
        tree = cKDTree(position[wall_rows], balanced_tree=False, compact_nodes=False)
        _, found = tree.query(position[dummies] + 0.25 * to_surface[dummies], workers=-1)
        result[dummies] = wall_rows[found]
    return result
