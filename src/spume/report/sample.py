"""Which particles a report shows: evenly spread ones, and those with extreme values in any frame."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

LARGEST_COUNT = 20_000
"""Particles that a page shows at most."""

_PRESELECTED = 40  # rows per wanted row beyond which a random part is looked at


def even(position: NDArray[np.floating], spacing: float, count: int) -> NDArray[np.int64]:
    """Return rows that fill the same space evenly, at most `count` of them, in ascending order.

    Space is cut into cells, as small as the count allows, and the first row in each cell is taken.

    Args:
        position: positions of all rows [m], shape (rows, dimension).
        spacing: their spacing [m].
        count: largest number of rows.
    """
    rows, dimension = position.shape
    if rows <= count:
        return np.arange(rows)
    if count <= 0:
        return np.arange(0)
    chosen = np.arange(rows)
    if rows > _PRESELECTED * count:
        chosen = np.sort(np.random.default_rng(0).choice(rows, _PRESELECTED * count // 2, replace=False))
    lower = position.min(axis=0)
    size = spacing * (rows / count) ** (1.0 / dimension)
    while True:
        cell = np.floor((position[chosen] - lower) / size).astype(np.int64)
        along = cell.max(axis=0) + 1
        key = cell[:, 0]
        for axis in range(1, dimension):
            key = key * along[axis] + cell[:, axis]
        first = np.unique(key, return_index=True)[1]
        if len(first) <= count:
            return np.sort(chosen[first])
        size *= max(1.005, (len(first) / count) ** (1.0 / dimension))


def extremes(position: NDArray[np.floating], values: dict[str, NDArray[np.floating]]) -> dict[str, tuple[int, int]]:
    """Return, for every coordinate (``x``, ``y``, ``z``) and value, the rows with the smallest and the largest one.

    Values that are not finite are passed over; where none is finite there is no entry.

    Args:
        position: positions [m], shape (rows, dimension).
        values: name to values, shape (rows,).
    """
    found = {}
    for name, column in ({a: position[:, k] for k, a in enumerate("xyz"[: position.shape[1]])} | values).items():
        good = np.isfinite(column)
        if np.all(good) and len(column):
            found[name] = (int(np.argmin(column)), int(np.argmax(column)))
        elif np.any(good):
            rows = np.flatnonzero(good)
            found[name] = (int(rows[np.argmin(column[rows])]), int(rows[np.argmax(column[rows])]))
    return found


def some_frames(count: int, largest: int) -> NDArray[np.int64]:
    """Return the numbers of at most `largest` frames, evenly spread, the first and the last among them."""
    if count <= largest:
        return np.arange(count)
    return np.unique(np.round(np.linspace(0, count - 1, largest)).astype(np.int64))


def rows_of(ids: NDArray[np.int64]) -> Callable[[NDArray[np.int64]], tuple[NDArray[np.int64], NDArray[np.bool_]]]:
    """Return what finds rows in ascending identity numbers: their indices, and which of them are there."""

    def find(wanted: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        if not len(ids):
            return np.zeros(len(wanted), dtype=np.int64), np.zeros(len(wanted), dtype=bool)
        index = np.minimum(np.searchsorted(ids, wanted), len(ids) - 1)
        return index, ids[index] == wanted

    return find
