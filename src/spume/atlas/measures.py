"""What the atlas measures of every run, whatever the problem."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spume.validation.folder import Folder
from spume.validation.study import rms

REACH = 2.1
"""Distance of the neighbours that a plane is fitted to [l0]."""


def spatial_noise(position: NDArray[np.float64], pressure: NDArray[np.float64], spacing: float) -> float:
    """Return the rms over the fluid of p_i - q_i [Pa], q_i the plane fitted to the pressures of the other particles.

    The plane minimises sum_j (p_j - q(x_j))^2 over the particles within 2.1 l0; those with fewer than six are left out.
    A pressure that is linear in space has none of it, white noise of deviation s has 1 to 1.3 s.
    Positions [m] have the shape (particles, d), pressures [Pa] (particles,).
    """
    from scipy.spatial import cKDTree

    found = cKDTree(position).query_pairs(REACH * spacing, output_type="ndarray")
    i, j = np.concatenate([found, found[:, ::-1]]).T
    basis = np.column_stack([np.ones(len(i)), (position[j] - position[i]) / spacing])
    count, size = len(position), basis.shape[1]
    moments, right = np.zeros((count, size, size)), np.zeros((count, size))
    np.add.at(moments, i, basis[:, :, None] * basis[:, None, :])
    np.add.at(right, i, basis * pressure[j, None])
    enough = (np.bincount(i, minlength=count) >= 6) & (np.abs(np.linalg.det(moments)) > 1e-6)
    if not enough.any():
        return float("nan")
    plane = np.linalg.solve(moments[enough], right[enough][:, :, None])[:, 0, 0]
    return rms(pressure[enough] - plane)


def temporal_noise(values: NDArray[np.float64]) -> float:
    """Return the rms of v_(k+1) - 2 v_k + v_(k-1) over sqrt(6), the deviation of white noise; shape (instants,)."""
    return rms(np.diff(values, 2)) / float(np.sqrt(6.0)) if len(values) > 2 else float("nan")


def disorder(position: NDArray[np.float64], spacing: float) -> float:
    """Return the rms over the fluid of 1 - (distance of the nearest other particle)/l0; zero on the lattice.

    Positions [m] have the shape (particles, d).
    """
    from scipy.spatial import cKDTree

    distance = cKDTree(position).query(position, k=2)[0][:, 1]
    return rms(1.0 - distance / spacing)


def of_frames(folder: Folder, scale: float) -> dict[str, float]:
    """Return noise in space (over a pressure scale [Pa]) and disorder, as means over the later half of the frames."""
    frames = [frame for frame in folder.frames() if frame.time >= 0.5 * folder.case.time.end]
    noises = [spatial_noise(f["position"], f["pressure"], f.spacing) / scale for f in frames]
    orders = [disorder(f["position"], f.spacing) for f in frames]
    return {"noise in space": float(np.mean(noises)), "disorder": float(np.mean(orders))}
