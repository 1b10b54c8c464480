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

    Space is cut into equal cells, as small as the count allows, and the row nearest to the middle of each is taken.

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
    place = position[chosen].astype(float)
    lower = place.min(axis=0)
    extent = place.max(axis=0) - lower + spacing
    size = spacing * (rows / count) ** (1.0 / dimension)
    while True:
        along = np.maximum(np.rint(extent / size), 1.0)
        share = (place - lower + 0.5 * spacing) / extent * along
        cell = np.minimum(np.floor(share), along - 1.0)
        key = np.ravel_multi_index(tuple(cell.T.astype(np.int64)), tuple(along.astype(np.int64)))
        found = len(np.unique(key))
        if found <= count:
            break
        size *= max(1.005, (found / count) ** (1.0 / dimension))
    order = np.lexsort((((share - cell - 0.5) ** 2).sum(axis=1), key))
    first = np.flatnonzero(np.diff(key[order], prepend=-1))
    return np.sort(chosen[order[first]])


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
    """Return the numbers of at most `largest` frames, evenly spread, with the first and last, shape (frames,)."""
    if count <= largest:
        return np.arange(count)
    return np.unique(np.round(np.linspace(0, count - 1, largest)).astype(np.int64))


def rows_of(ids: NDArray[np.int64]) -> Callable[[NDArray[np.int64]], tuple[NDArray[np.int64], NDArray[np.bool_]]]:
    """Return what finds rows in ascending identity numbers, shape (rows,): indices, and which of them are there."""

    def find(wanted: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        if not len(ids):
            return np.zeros(len(wanted), dtype=np.int64), np.zeros(len(wanted), dtype=bool)
        index = np.minimum(np.searchsorted(ids, wanted), len(ids) - 1)
        return index, ids[index] == wanted

    return find
