"""The surface of the water, reconstructed from particles: an isosurface of the filled part of space.

The filled part is a sum of Gaussians, one a particle; near a wall it is related to the space that the wall leaves:

    χ(x) = Σ_fluid G l0³ / (1 − Σ_solid G l0³),   G = exp(−r²/2σ²) / (2π σ²)^(3/2),   σ = 0.8 l0,

on a grid of l0/2. The surface is χ = 1/2, closed a quarter of a spacing off the walls. A wave shorter than about
two spacings is smoothed away; a particle at which χ < 0.3 is no part of the surface, but spray, and returned as such.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume.outputs.snapshot import DUMMY, FLUID, WALL
from spume.outputs.vtkhdf import Frame

WIDTH = 0.8
"""Standard deviation of the Gaussian of a particle [l0]."""

_MARGIN = 4.0  # of the grid around the fluid [l0]
_NODES = 30_000_000  # of the grid at most; it is coarsened beyond
_SPRAY = 0.3
_OWN = 0.1  # of space that a body fills at its surface, a spacing from where it meets others
_BEHIND = 0.36  # a quarter of a spacing off the wall, or wall and water would flicker where they coincide


@dataclass(frozen=True)
class Surface:
    """A reconstructed surface.

    Attributes:
        mesh: PyVista's mesh, empty where all is spray; its point data ``value`` is the quantity asked for.
        spray: positions of the particles that are no part of it [m], shape (particles, 3).
        spray_values: the quantity there, shape (particles,).
    """

    mesh: Any
    spray: NDArray[np.float64]
    spray_values: NDArray[np.float64]


def filled(
    position: NDArray[np.float64], lower: NDArray[np.float64], shape: tuple[int, ...], cell: float, spacing: float,
    weight: NDArray[np.float64] | None = None,
) -> NDArray[np.float32]:  # fmt: skip
    """Return the part of space that particles fill at the nodes of a grid [1], shape `shape`.

    Args:
        position: centres of the particles [m], shape (particles, 3).
        lower: first node of the grid [m], shape (3,).
        shape: nodes along each axis.
        cell: distance of the nodes [m].
        spacing: l0 [m].
        weight: what each particle counts, shape (particles,); default: one.
    """
    from scipy.ndimage import gaussian_filter

    grid = np.zeros(shape, dtype=np.float32)
    where = (position - lower) / cell
    base = np.floor(where).astype(np.int64)
    share = where - base
    inside = np.all((base >= 0) & (base < np.array(shape) - 1), axis=1)
    base, share = base[inside], share[inside]
    mass = np.ones(len(base)) if weight is None else np.asarray(weight, dtype=float)[inside]
    mass = mass * (spacing / cell) ** len(shape)
    flat = grid.reshape(-1)
    for corner in np.ndindex(*(2,) * len(shape)):
        part = np.prod(np.where(np.array(corner) == 1, share, 1.0 - share), axis=1) * mass
        index = np.ravel_multi_index(tuple((base + np.array(corner)).T), shape)
        flat += np.bincount(index, part, minlength=flat.size).astype(np.float32)
    # A particle spread over its cell has the variance h²/6 already.
    sigma = np.sqrt((WIDTH * spacing) ** 2 - cell**2 / 6.0) / cell
    return np.asarray(gaussian_filter(grid, sigma, mode="constant", truncate=3.5))


def reconstruct(frame: Frame, values: NDArray[np.float64], smoothing: int = 20) -> Surface:
    """Return the surface of the water of a frame in 3D.

    Args:
        frame: the frame, with ``position`` and ``kind``.
        values: the quantity that colours the surface, shape (rows,).
        smoothing: passes of Taubin's filter, which keeps the volume.
    """
    import pyvista

    l0 = frame.spacing
    position = np.asarray(frame["position"], dtype=float)
    kind = np.asarray(frame["kind"])
    fluid, solid = kind == FLUID, (kind == WALL) | (kind == DUMMY)
    water = position[fluid]
    if len(water) == 0:
        return Surface(pyvista.PolyData(), np.zeros((0, 3)), np.zeros(0))
    lower, upper = water.min(axis=0) - _MARGIN * l0, water.max(axis=0) + _MARGIN * l0
    cell = _cell(lower, upper, l0)
    shape = tuple(int(n) for n in np.ceil((upper - lower) / cell) + 1)
    near = solid & np.all((position > lower) & (position < upper), axis=1)
    whole = filled(water, lower, shape, cell, l0)
    behind = filled(position[near], lower, shape, cell, l0)
    chi = whole / np.maximum(1.0 - behind, 0.05)
    amount = filled(water, lower, shape, cell, l0, values[fluid])
    mean = amount / np.maximum(whole, 1e-6)
    grid = pyvista.ImageData(dimensions=shape, spacing=(cell,) * 3, origin=lower)
    # Above 1/2 in the water and on this side of the wall.
    grid.point_data["inside"] = np.minimum(chi - 0.5, _BEHIND - behind).reshape(-1, order="F")
    grid.point_data["value"] = mean.reshape(-1, order="F")
    mesh = grid.contour([0.0], scalars="inside")
    if mesh.n_points and smoothing:
        mesh = mesh.smooth_taubin(n_iter=smoothing, pass_band=0.1)
    index = tuple(np.rint((water - lower) / cell).astype(int).T)
    spray = chi[index] < _SPRAY
    return Surface(mesh, water[spray], values[fluid][spray])


def solid(position: NDArray[np.float64], others: NDArray[np.float64], spacing: float, smoothing: int = 30) -> Any:
    """Return the surface of a body from its rows, as PyVista's mesh: where Σ G l0³ = 1/2.

    Args:
        position: of the body's rows [m], shape (rows, 3).
        others: of the walls that it may stand on, shape (rows, 3); their own surface is no part of the mesh.
        spacing: l0 [m].
        smoothing: passes of Taubin's filter.
    """
    import pyvista

    if len(position) == 0:
        return pyvista.PolyData()
    lower, upper = position.min(axis=0) - _MARGIN * spacing, position.max(axis=0) + _MARGIN * spacing
    cell = _cell(lower, upper, spacing)
    shape = tuple(int(n) for n in np.ceil((upper - lower) / cell) + 1)
    grid = pyvista.ImageData(dimensions=shape, spacing=(cell,) * 3, origin=lower)
    own = filled(position, lower, shape, cell, spacing)
    grid.point_data["inside"] = (own + filled(others, lower, shape, cell, spacing)).reshape(-1, order="F")
    grid.point_data["own"] = own.reshape(-1, order="F")
    mesh = grid.contour([0.5], scalars="inside")
    if not mesh.n_points:
        return mesh
    return mesh.smooth_taubin(n_iter=smoothing, pass_band=0.1).clip_scalar(scalars="own", invert=False, value=_OWN)


def _cell(lower: NDArray[np.float64], upper: NDArray[np.float64], spacing: float) -> float:
    """Return the distance of nodes [m] of a grid between two corners."""
    return max(0.5 * spacing, float(np.prod(upper - lower) / _NODES) ** (1.0 / 3.0))
