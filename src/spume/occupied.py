"""Which cells of the common lattice are taken: cells as numbers that can be looked up."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spume.case import Case
from spume.geometry.grid import Grid


def keys_of(cells: NDArray[np.int64], grid: Grid, case: Case) -> NDArray[np.int64]:
    """Return one number per cell, shape (n,), of cells of shape (n, d); cells a period apart have the same one."""
    cells = cells.copy()
    for k, (_, period) in case.domain.periods().items():
        cells[:, k] %= round(period / grid.spacing)
    bits = 63 // grid.dimension
    offset = cells + (1 << (bits - 1))
    keys = np.zeros(len(cells), dtype=np.int64)
    for column in offset.T:
        keys = (keys << bits) | column
    return keys


def among(keys: NDArray[np.int64], others: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Return which of the keys, shape (n,), occur among the others; these are nearly in order, so sorting is quick."""
    if not len(others):
        return np.zeros(len(keys), dtype=bool)
    others = np.sort(others, kind="stable")
    place = np.minimum(np.searchsorted(others, keys), len(others) - 1)
    return others[place] == keys
