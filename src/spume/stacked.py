"""Fluids that stand on each other: what a hydrostatic pressure must carry beside its own fluid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from spume.case import Case
from spume.geometry.grid import Grid
from spume.occupied import keys_of


def loads(case: Case, grid: Grid, wet: Sequence[NDArray[np.float64]]) -> list[NDArray[np.float64]]:
    """Return for each fluid what the others above add to rho |g| times the depth below its top [Pa], shape (n,).

    The column over a cell goes, along the axis nearest to gravity, from cell to cell as far as there is fluid
    without a gap: a drop that falls towards a pool does not weigh on it. Each cell of another fluid counts with its
    density, less that of the own fluid where it lies below the own top, for the depth counts the own one there.

    Args:
        case: the case.
        grid: its lattice.
        wet: cell centres [m] of each fluid at rest, shape (n, d).
    """
    assert case.domain.gravity is not None
    gravity = case.domain.gravity.at(0.0)
    size = float(np.linalg.norm(gravity))
    if len(wet) == 1 or size == 0.0:
        return [np.zeros(len(points)) for points in wet]
    axis = int(np.abs(gravity).argmax())
    points = np.concatenate(wet)
    material = np.repeat(np.arange(len(wet)), [len(mine) for mine in wet])
    density = np.array([fluid.density for fluid in case.fluid])
    height = points @ (-gravity / size)
    above = _next(case, grid, points, axis, 1 if gravity[axis] < 0.0 else -1)
    found = []
    for index, fluid in enumerate(case.fluid):
        lower, upper = fluid.shape.snapped(grid)[0].bounds()
        top = float(np.where(gravity < 0.0, upper, lower) @ (-gravity / size))
        extra = density[material] - density[index] * (height < top)
        weight = np.where(material == index, 0.0, extra) * abs(gravity[axis]) * grid.spacing
        found.append(_sum_along(above, weight)[material == index])
    return found


def _next(case: Case, grid: Grid, points: NDArray[np.float64], axis: int, up: int) -> NDArray[np.int64]:
    """Return the index of the cell above each, shape (n,); -1 where there is none."""
    cells = grid.cells(points)
    higher = cells.copy()
    higher[:, axis] += up
    keys, wanted = keys_of(cells, grid, case), keys_of(higher, grid, case)
    order = np.argsort(keys, kind="stable")
    place = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)]
    there = (keys[place] == wanted) & (cells[place, axis] == higher[:, axis])  # no column goes round a period
    return np.where(there, place, -1)


def _sum_along(following: NDArray[np.int64], weight: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return for each cell the sum of the weights of all that follow it; each round doubles how far it looks."""
    end = len(weight)
    jump = np.append(np.where(following < 0, end, following), end)
    total = np.append(weight, 0.0)[jump]
    while (jump < end).any():
        total = total + total[jump]
        jump = jump[jump]
    return total[:end]
