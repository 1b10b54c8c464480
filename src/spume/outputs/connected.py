"""Which particles belong to one body of fluid: connected components over cells of size 1.25 l0."""

from __future__ import annotations

import itertools
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from spume.outputs.snapshot import Snapshot

_CELL = 1.25  # size of a cell [l0]


def components(
    position: NDArray[np.floating], spacing: float, periods: Mapping[int, float] | None = None
) -> NDArray[np.int64]:
    """Return the number of the connected component of every point, shape (points,).

    Space is divided into cells of size 1.25 l0; occupied cells that share a face, an edge or a corner are
    connected. So all points closer than 1.25 l0 are together, as the columns of a lattice that a wave stretches,
    and a gap of more than 2.5 √d l0 parts them.
    Component 0 is the largest, 1 the next.

    Args:
        position: of the points [m], shape (points, d).
        spacing: l0 [m].
        periods: number of each periodic axis to the length of its period [m]; cells there are as much wider as it takes
            to fill the period.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    d = position.shape[1]
    if len(position) == 0:
        return np.zeros(0, dtype=np.int64)
    wide = np.full(d, _CELL * spacing)
    around = {k: max(int(length / wide[k]), 1) for k, length in (periods or {}).items()}
    for k, number in around.items():
        wide[k] = (periods or {})[k] / number
    cells = np.floor(position / wide).astype(np.int64)
    cells -= cells.min(axis=0) - 1
    for k, number in around.items():
        cells[:, k] %= number
    size = cells.max(axis=0) + 2
    strides = np.append(np.cumprod(size[::-1])[::-1][1:], 1)
    keys, one, index = np.unique(cells @ strides, return_index=True, return_inverse=True)
    occupied = cells[one]
    first, second = [], []
    for shift in itertools.product((-1, 0, 1), repeat=d):
        if shift <= (0,) * d:  # every pair once
            continue
        beside = occupied + shift
        for k, number in around.items():
            beside[:, k] %= number
        wanted = beside @ strides
        found = np.minimum(np.searchsorted(keys, wanted), len(keys) - 1)
        there = keys[found] == wanted
        first.append(np.flatnonzero(there))
        second.append(found[there])
    i, j = np.concatenate(first), np.concatenate(second)
    graph = coo_array((np.ones(len(i), dtype=np.int8), (i, j)), shape=(len(keys), len(keys)))
    _, label = connected_components(graph, directed=False)
    labels = label[index.reshape(-1)]
    rank = np.empty(labels.max() + 1, dtype=np.int64)
    rank[np.argsort(-np.bincount(labels), kind="stable")] = np.arange(len(rank))
    return rank[labels]


def main_body(snapshot: Snapshot) -> NDArray[np.bool_]:
    """Return the mask of the fluid rows of the largest connected body of fluid, shape (rows,)."""

    def compute(s: Snapshot) -> NDArray[np.bool_]:
        mask = np.zeros(len(s), dtype=bool)
        rows = np.flatnonzero(s.fluid)
        mask[rows[components(np.asarray(s["position"], dtype=float)[rows], s.spacing, s.periods) == 0]] = True
        return mask

    mask: NDArray[np.bool_] = snapshot.derived("main body", compute)
    return mask
