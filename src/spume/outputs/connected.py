"""Which particles belong to one body of fluid: connected components over cells of size 1.25 l0."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from spume.outputs.snapshot import Snapshot

_CELL = 1.25  # size of a cell [l0]


def components(position: NDArray[np.floating], spacing: float) -> NDArray[np.int64]:
    """Return the number of the connected component of every point, shape (points,).

    Space is divided into cells of size 1.25 l0; occupied cells that share a face, an edge or a corner are
    connected. So all points closer than 1.25 l0 are together, as the columns of a lattice that a wave stretches,
    and a gap of more than 2.5 √d l0 parts them.
    Component 0 is the largest, 1 the next.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    d = position.shape[1]
    if len(position) == 0:
        return np.zeros(0, dtype=np.int64)
    cells = np.floor(position / (_CELL * spacing)).astype(np.int64)
    cells -= cells.min(axis=0) - 1
    size = cells.max(axis=0) + 2
    strides = np.append(np.cumprod(size[::-1])[::-1][1:], 1)
    keys, index = np.unique(cells @ strides, return_inverse=True)
    first, second = [], []
    for shift in itertools.product((-1, 0, 1), repeat=d):
        step = int(np.dot(shift, strides))
        if step <= 0:  # every pair once
            continue
        found = np.minimum(np.searchsorted(keys, keys + step), len(keys) - 1)
        there = keys[found] == keys + step
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
        mask[rows[components(np.asarray(s["position"], dtype=float)[rows], s.spacing) == 0]] = True
        return mask

    mask: NDArray[np.bool_] = snapshot.derived("main body", compute)
    return mask
