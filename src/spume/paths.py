"""Paths of bodies: which of them would run through others."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume.case import Case
from spume.geometry.grid import Grid
from spume.moving import moving_together
from spume.occupied import among, keys_of
from spume.outputs import Snapshot
from spume.particles import FLUID

_INSTANTS = 200  # of the run at which is looked
_SAMPLES = 1000  # rows of a body that are followed


def crossings(case: Case, grid: Grid, snapshot: Snapshot) -> Iterator[tuple[int, int, float]]:
    """Yield the bodies that come to lie deep in another one: their index, that of the other, and when first [s].

    Deep is a cell that has cells of the other one on all sides: bodies that slide along each other, or a flap whose
    edge turns a little into the floor, are as they are meant. Motions of the whole tank part no body from another.

    Args:
        case: the case.
        grid: its lattice.
        snapshot: its initial rows.
    """
    position, solid, owner = snapshot["position"], snapshot["kind"] != FLUID, snapshot["body"]
    groups = moving_together(case)
    said: set[frozenset[int]] = set()
    for members in groups:
        first: Any = case.body[members[0]]
        if getattr(first, "motion", None) is None:
            continue
        rows = np.flatnonzero(solid & np.isin(owner, members))
        rows = rows[:: math.ceil(len(rows) / _SAMPLES) or 1]
        for others in groups:
            theirs = solid & np.isin(owner, others)
            if others == members or not len(rows) or not theirs.any():
                continue
            deep = _Deep(case, grid, position[theirs], owner[theirs])
            second: Any = case.body[others[0]]
            last = min(getattr(body, "until", None) or math.inf for body in (first, second))
            for t in np.linspace(0.0, min(last, case.time.end), _INSTANTS):
                places = first.pose(float(t), case.dimension)(position[rows])
                pose = second.pose(float(t), case.dimension)
                met = deep.bodies(places if pose is None else pose.origin(places))
                for row, body in zip(rows[met >= 0], met[met >= 0], strict=True):
                    pair = int(owner[row]), int(body)
                    if frozenset(pair) not in said:
                        said.add(frozenset(pair))
                        yield (*pair, float(t))


class _Deep:
    """The cells of bodies that have others of them on all sides.

    Args:
        case: the case.
        grid: its lattice.
        points: rows of the bodies at the start [m], shape (n, d).
        owner: body of each row, shape (n,).
    """

    def __init__(self, case: Case, grid: Grid, points: NDArray[np.float64], owner: NDArray[np.int32]) -> None:
        cells = grid.cells(points)
        keys = keys_of(cells, grid, case)
        inner = np.ones(len(keys), dtype=bool)
        for step in np.eye(grid.dimension, dtype=np.int64):
            for beside in (cells + step, cells - step):
                inner &= among(keys_of(beside, grid, case), keys)
        order = np.argsort(keys[inner], kind="stable")
        self._keys, self._owner = keys[inner][order], owner[inner][order]
        self._case, self._grid = case, grid
        free = [k not in case.domain.periods() for k in range(grid.dimension)]
        self._lower = np.where(free, points.min(axis=0), -np.inf)
        self._upper = np.where(free, points.max(axis=0), np.inf)

    def bodies(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the body in whose cells points [m], shape (n, d), lie; -1 where in none."""
        found = np.full(len(points), -1, dtype=np.int64)
        near = np.flatnonzero(np.all((points >= self._lower) & (points <= self._upper), axis=1))
        if not len(self._keys) or not len(near):
            return found
        keys = keys_of(self._grid.cells(points[near]), self._grid, self._case)
        place = np.minimum(np.searchsorted(self._keys, keys), len(self._keys) - 1)
        found[near] = np.where(self._keys[place] == keys, self._owner[place], -1)
        return found
