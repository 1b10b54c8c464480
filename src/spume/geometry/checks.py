"""What shapes are asked before anything is computed: units of a drawing, parts thinner than the spacing resolves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume.geometry.grid import Grid
from spume.geometry.shapes import Shape
from spume.geometry.stl import Stl
from spume.named import Location, Parameters, walk

_LARGEST_RATIO = 100.0  # of a drawing's size to that of the rest of the case
_LARGE_RATIO = 10.0  # from which on a drawing is rather mistaken than meant: centimetres, or a coast with little water
_SAMPLES = 4000
_LOST = 2.0  # a surface farther than this from any row of its wall has none [l0]
_THIN = 2.0  # water on both sides of a thinner part is within the reach of the operators [l0]
_MUCH = 0.05  # share of the surface from which on thin parts are more than a body's sharp edges
_SHELL = 'of the shell of a tank, draw the room inside and say wetted = "inside"'
_OFF = 0.1  # relative error of a fluid's volume


def mistaken_units(
    shapes: Sequence[tuple[Location, Shape]], corners: Sequence[Sequence[float]], spacing: float
) -> Iterator[tuple[Location, str, Any]]:
    """Yield place, message and value of drawings whose size does not suit the rest of the case.

    Args:
        shapes: every shape of the case and where it stands.
        corners: points [m] that say how large the case is, besides shapes without drawings.
        spacing: l0 [m].
    """
    for loc, drawing, own, size in _sizes(shapes, corners):
        said = f"with it the drawing is {own:.3g} m long, the rest of the case {size:.3g} m"
        if own > _LARGEST_RATIO * size:
            unit = f"; is the drawing in millimetres? Then scale = {0.001 * drawing.scale:g}"
            yield (*loc, "scale"), said + unit, drawing.scale
        elif own < size / _LARGEST_RATIO and own < 3.0 * spacing:  # a small thing that is resolved may be meant
            unit = f"; was it drawn in metres? Then scale = {1000.0 * drawing.scale:g}"
            yield (*loc, "scale"), f"{said} and the spacing {spacing:g} m{unit}", drawing.scale


def unlikely_sizes(
    shapes: Sequence[tuple[Location, Shape]], corners: Sequence[Sequence[float]]
) -> Iterator[tuple[Location, str]]:
    """Yield place and sentence of drawings that may be meant, but extend far beyond the rest of the case.

    Args:
        shapes, corners: see `mistaken_units`.
    """
    for loc, drawing, own, size in _sizes(shapes, corners):
        if own > _LARGE_RATIO * size:
            centi, milli = 0.01 * drawing.scale, 0.001 * drawing.scale
            yield (
                (*loc, "scale"),
                f"the drawing is {own:.3g} m long, the rest of the case {size:.3g} m, and walls all over it "
                f"take particles and time; is it in centimetres or millimetres? Then scale = {centi:g} or {milli:g}",
            )


def _sizes(
    shapes: Sequence[tuple[Location, Shape]], corners: Sequence[Sequence[float]]
) -> Iterator[tuple[Location, Stl, float, float]]:
    """Yield place, drawing, its largest extent [m] and that of what is not drawn [m]; nothing where all is drawn."""
    drawings: list[tuple[Location, Stl]] = []
    rest = [np.asarray(corner, dtype=float) for corner in corners]
    for loc, shape in shapes:
        found: list[tuple[Location, Stl]] = []

        def visit(item: Parameters, at: Location, found: list[tuple[Location, Stl]] = found) -> None:
            if isinstance(item, Stl):
                found.append((at, item))

        walk(shape, visit, loc)
        drawings += found
        if not found:
            rest += list(shape.bounds())
    if not rest or not drawings or any(len(corner) != 3 for corner in rest):
        return
    size = float(np.ptp(rest, axis=0).max())
    for loc, drawing in drawings:
        lower, upper = drawing.bounds()
        yield loc, drawing, float((upper - lower).max()), size


def unresolved(shape: Shape, grid: Grid, rows: NDArray[np.float64]) -> list[str]:
    """Return sentences on the parts of a solid that the spacing does not resolve.

    Args:
        shape: the solid, wet outside.
        grid: the lattice.
        rows: positions of the wall's rows [m], shape (n, d).

    Raises:
        ValueError: most of the solid has no row.
    """
    from scipy.spatial import cKDTree

    l0 = grid.spacing
    points, normals = shape.facets().samples(_SAMPLES)
    thickness = np.full(len(points), np.inf)
    for step in np.arange(_THIN - 0.05, 0.0, -0.1):
        left = ~shape.inside(points - step * l0 * normals)
        thickness[left] = step * l0
    lost = np.ones(len(points), dtype=bool)
    if len(rows):
        lost = cKDTree(rows).query(points)[0] > _LOST * l0
    thin = float(np.min(thickness[lost], initial=np.inf))
    remedy = f"choose spacing = {_nice(min(thin, l0) / _THIN):g} or less, or make it thicker; {_SHELL}"
    if lost.mean() > 0.5:
        raise ValueError(f"most of it is thinner than the spacing of {l0:g} m and holds no particle: {remedy}")
    said = []
    if lost.any():
        said.append(
            f"{_share(lost)} of its surface is farther than {_LOST:g} spacings from any particle of the wall, as at "
            f"{_at(points[lost][0])}: that part is thinner than the spacing and water passes it; {remedy}"
        )
    narrow = np.isfinite(thickness) & ~lost
    if narrow.mean() > _MUCH:
        thinnest = int(np.flatnonzero(narrow)[thickness[narrow].argmin()])
        least = _nice(thickness[thinnest] / _THIN)
        said.append(
            f"{_share(narrow)} of its surface belongs to parts thinner than {_THIN:g} spacings, as at "
            f"{_at(points[thinnest])}: water on both sides would feel each other; choose spacing = {least:g} or "
            "less, or make it thicker"
        )
    return said


def volume_of(shape: Shape, grid: Grid, particles: int) -> list[str]:
    """Return a sentence if the particles of a filled shape have another volume than it has."""
    volume, full = particles * grid.spacing**grid.dimension, shape.measure()
    if abs(volume - full) <= _OFF * full:
        return []
    unit = "m^3" if grid.dimension == 3 else "m^2"
    return [
        f"its {particles} particles have {volume:.4g} {unit}, the shape {full:.4g} {unit}: a smaller spacing follows "
        "its surface better"
    ]


def _nice(value: float) -> float:
    return float(f"{value:.2g}")


def _share(which: NDArray[np.bool_]) -> str:
    return f"{max(float(which.mean()), 0.001):.1%}"


def _at(point: NDArray[np.float64]) -> str:
    return f"({', '.join(f'{x:.4g}' for x in point)}) m"
