"""Global sums over the fluid: mass, momentum, energies, volume."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spume.outputs.snapshot import Snapshot


def mass(snapshot: Snapshot) -> NDArray[np.float64]:
    """Return m = ρ l0^d of every fluid row, shape (fluid rows,) [kg; kg/m in 2D]."""
    density: NDArray[np.float64] = np.asarray(snapshot["density"], dtype=float)[snapshot.fluid]
    return density * snapshot.spacing**snapshot.dimension


def kinetic_energy(snapshot: Snapshot) -> float:
    """Return Σ m |u|² / 2 over the fluid [J; J/m in 2D]."""
    velocity = np.asarray(snapshot["velocity"], dtype=float)[snapshot.fluid]
    return float(0.5 * mass(snapshot) @ np.einsum("ij,ij->i", velocity, velocity))


def potential_energy(snapshot: Snapshot) -> float:
    """Return Σ m (k |x − c|²/2 − g·x) over the fluid [J; J/m in 2D].

    g is uniform, k and c are stiffness and focus of a central gravity, 0 without one. Zero at the origin of
    coordinates, or where all is in the focus.
    """
    position = np.asarray(snapshot["position"], dtype=float)[snapshot.fluid]
    from_focus = position - snapshot.focus
    central = 0.5 * snapshot.stiffness * np.einsum("ij,ij->i", from_focus, from_focus)
    return float(mass(snapshot) @ (central - position @ snapshot.gravity))


def momentum(snapshot: Snapshot) -> NDArray[np.float64]:
    """Return Σ m u over the fluid, shape (d,) [kg m/s; kg/s in 2D]."""
    velocity = np.asarray(snapshot["velocity"], dtype=float)[snapshot.fluid]
    return mass(snapshot) @ velocity


def volume(snapshot: Snapshot, lower: ArrayLike = -np.inf, upper: ArrayLike = np.inf) -> float:
    """Return the volume that the fluid fills [m^3; m^2 in 2D].

    V = Σ l0^d n0 / n_i over the interior rows, plus l0^d for every row on the free surface, where n_i
    says nothing about volume. N l0^d is a constant and would hide any drift.

    Args:
        snapshot: the state.
        lower, upper: corners [m] of a box, shape (d,): rows whose centre lies in it; default: all.
    """
    fluid = snapshot.fluid
    if np.any(np.isfinite(lower)) or np.any(np.isfinite(upper)):
        position = np.asarray(snapshot["position"], dtype=float)
        fluid = fluid & np.all((position >= lower) & (position < upper), axis=1)
    cell = snapshot.spacing**snapshot.dimension
    interior = np.asarray(snapshot["free_surface"])[fluid] == 0
    n = np.asarray(snapshot["number_density"], dtype=float)[fluid][interior]
    n = n[n > 0.0]  # before the first step there is no n: such rows count l0^d
    rows = int(np.count_nonzero(fluid))
    if not np.isfinite(snapshot.n0):
        return rows * cell
    return float(cell * (np.sum(snapshot.n0 / n) + (rows - len(n))))
