"""One judge for the positions that any particle code computed: crowding, front, volume."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

REACH = 2.1
"""Effective radius of the number density [l0]."""
INSIDE = 0.85
"""Rows with n/n0 below this, and rows near such rows, count as surface or splash."""


@dataclass(frozen=True)
class Verdict:
    """How well positions fill the space.

    Attributes:
        error: mean over time and interior rows of |n - n0|/n0.
        signed: the same without the absolute value: positive where the water is compressed.
        judged: mean number of interior rows a frame.
        front: largest x of the water at each frame [m].
        volume: change of the volume that the interior rows fill, last frame against first: n0/n.
    """

    error: float
    signed: float
    judged: float
    front: list[float]
    volume: float


def number_density(x: NDArray[np.float64], spacing: float) -> NDArray[np.float64]:
    """Return n_i = sum over the fluid of re/r - 1, shape (rows,)."""
    re = REACH * spacing
    pairs = cKDTree(x).query_pairs(re, output_type="ndarray")
    r = np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1)
    w = re / np.maximum(r, 1e-3 * spacing) - 1.0
    return np.bincount(pairs[:, 0], w, len(x)) + np.bincount(pairs[:, 1], w, len(x))


def lattice_density() -> float:
    """Return n0 of the cubic lattice."""
    k = np.arange(-3, 4)
    r = np.linalg.norm(np.stack(np.meshgrid(k, k, k), -1).reshape(-1, 3), axis=1)
    r = r[(r > 0) & (r < REACH)]
    return float((REACH / r - 1.0).sum())


def judge(frames: list[NDArray[np.float64]], spacing: float, tank: tuple[float, float, float]) -> Verdict:
    """Judge the frames of one run, each (rows, 3) [m].

    Walls are left out of the sums, so rows nearer than re to one are not judged, nor rows of the free surface
    and of the splash, nor their neighbours.
    """
    n0, re = lattice_density(), REACH * spacing
    errors, signed, sizes, front, volume = [], [], [], [], []
    for x in frames:
        n = number_density(x, spacing) / n0
        tree = cKDTree(x)
        clear = np.all(x > re, axis=1) & np.all(x < np.array(tank) - re, axis=1)
        wall = ~(np.all(x > re, axis=1) & np.all(x < np.array(tank) - re, axis=1))
        surface = (n < INSIDE) & ~wall
        near = np.zeros(len(x), dtype=bool)
        if surface.any():
            near[np.unique(np.concatenate(tree.query_ball_point(x[surface], re)).astype(int))] = True
        inside = clear & ~near
        front.append(float(x[:, 0].max() + spacing / 2))
        if inside.sum() < 20:
            continue
        errors.append(float(np.abs(n[inside] - 1.0).mean()))
        signed.append(float((n[inside] - 1.0).mean()))
        sizes.append(int(inside.sum()))
        volume.append(float((1.0 / n[inside]).mean()))
    return Verdict(
        float(np.mean(errors)), float(np.mean(signed)), float(np.mean(sizes)), front, volume[-1] / volume[0] - 1.0
    )
