"""Which rows are near places."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from spume.outputs.snapshot import Snapshot


def nearest(snapshot: Snapshot, points: NDArray[np.float64], kinds: int, reach: float) -> NDArray[np.intp]:
    """Return the row of some kinds that is nearest to each point, shape (n,), -1 where none is within reach.

    Args:
        snapshot: the state.
        points: places [m], shape (n, d); rows are near through periodic boundaries too.
        kinds: kinds of the rows.
        reach: largest distance [l0].
    """
    from scipy.spatial import cKDTree

    def chosen(s: Snapshot) -> tuple[NDArray[np.intp], cKDTree]:
        rows = np.flatnonzero(np.asarray(s["kind"]) & kinds)
        return rows, cKDTree(np.asarray(s["position"], dtype=float)[rows])

    rows, tree = snapshot.derived(("rows of", kinds), chosen)
    result, least = np.full(len(points), -1), np.full(len(points), np.inf)
    if len(points) == 0 or len(rows) == 0:
        return result
    shifts = [(0.0, period, -period) for period in snapshot.periods.values()]
    for ways in product(*shifts):
        shift = np.zeros(snapshot.dimension)
        shift[list(snapshot.periods)] = ways
        distance, found = tree.query(points + shift, distance_upper_bound=reach * snapshot.spacing)
        nearer = distance < least
        result[nearer], least[nearer] = rows[found[nearer]], distance[nearer]
    return result
