"""Quantities along a line over time: between gauges that stand in one, or from the frames of a run."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume.outputs.gauges.elevation import Elevation
from spume.outputs.gauges.pressure import point_value, wet_rows
from spume.outputs.snapshot import FLUID, WALL, Snapshot
from spume.outputs.vtkhdf import Frame

_FEWEST = 3  # gauges that make a line
_INSTANTS = 800  # of a diagram
_PLACES = 160  # along a line
_NEAREST = 6  # rows whose faces say whether a point is in a wall: one at an edge knows one face of two


@dataclass(frozen=True)
class Diagram:
    """A quantity along a line over time.

    Attributes:
        quantity: what it is: ``elevation``, ``pressure``.
        unit: its SI unit.
        axis: the coordinate along the line: ``x``, ``y`` or ``z``, or ``s`` from its first point.
        vertical: whether the line points up.
        place: coordinate along the line [m], shape (places,).
        time: t [s], shape (instants,).
        values: the quantity, NaN where there is none, shape (instants, places).
        marks: where gauges stand [m], shape (gauges,).
        note: where the line is.
    """

    quantity: str
    unit: str
    axis: str
    vertical: bool
    place: NDArray[np.float64]
    time: NDArray[np.float64]
    values: NDArray[np.float64]
    marks: NDArray[np.float64]
    note: str


def gauges_in_line(gauges: Iterable[Mapping[str, Any]], kind: str) -> list[tuple[str, NDArray[np.float64]]]:
    """Return name and place of the most gauges of a kind that stand in one straight line, in its order.

    Args:
        gauges: the ``[[gauge]]`` tables of a case.
        kind: ``pressure``, ``elevation``.

    Returns:
        Names and places [m], shape (d,) or, for elevations, (d − 1,); none where fewer than three are in line.
    """
    found = [(str(g["name"]), np.atleast_1d(np.asarray(g["at"], dtype=float))) for g in gauges if _is(g, kind)]
    best: list[int] = []
    places = [place for _, place in found]
    for i in range(len(found)):
        for j in range(i + 1, len(found)):
            along = places[j] - places[i]
            length = float(np.linalg.norm(along))
            if length == 0.0:
                continue
            away = [place - places[i] - ((place - places[i]) @ along) / length**2 * along for place in places]
            there = [k for k, vector in enumerate(away) if float(np.linalg.norm(vector)) < 1e-6 * max(length, 1e-3)]
            if len(there) > len(best):
                best = there
    if len(best) < _FEWEST:
        return []
    along = places[best[-1]] - places[best[0]]
    return [found[k] for k in sorted(best, key=lambda k: float(places[k] @ along))]


def _is(gauge: Mapping[str, Any], kind: str) -> bool:
    return gauge.get("kind") == kind and isinstance(gauge.get("at"), list | tuple | float) and not gauge.get("body")


def between_gauges(
    line: Sequence[tuple[str, NDArray[np.float64]]],
    series: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]],
    quantity: str,
    unit: str,
    dimension: int,
) -> Diagram:
    """Return the diagram of gauges in a line; between two neighbours it is linear.

    Args:
        line: their names and places, as `gauges_in_line` gives them.
        series: times [s] and values of each, shape (instants,).
        quantity, unit: what they measure.
        dimension: 2 or 3.
    """
    marks, axis, note = _along(np.array([place for _, place in line]))
    _, first = np.unique(marks, return_index=True)
    line, marks = [line[i] for i in first], marks[first]
    begin = max(float(series[name][0][0]) for name, _ in line)
    end = min(float(series[name][0][-1]) for name, _ in line)
    count = min(_INSTANTS, max(len(series[name][0]) for name, _ in line))
    time = np.linspace(begin, end, max(count, 2))
    at_marks = np.column_stack([np.interp(time, *series[name]) for name, _ in line])
    place = np.linspace(marks[0], marks[-1], _PLACES)
    values = np.array([np.interp(place, marks, row) for row in at_marks])
    vertical = len(line[0][1]) == dimension and axis == "xyz"[dimension - 1]
    note = "; ".join(filter(None, [note, "linear between the gauges"]))
    return Diagram(quantity, unit, axis, vertical, place, time, values, marks, note)


def elevation_along(
    frames: Iterable[Frame], first: NDArray[np.float64], last: NDArray[np.float64], spacing: float
) -> Diagram:
    """Return the elevation along a horizontal line, measured in every frame as an elevation gauge would.

    There is none where the line is in a body that stands in the water.

    Args:
        frames: the frames.
        first, last: ends of the line [m], shape (d − 1,).
        spacing: l0 [m].
    """
    points, place, axis, note = _points(first, last, spacing)
    times, rows = [], []
    for frame in frames:
        position = np.asarray(frame["position"], dtype=float)
        near = _near(position[:, :-1], first, last, 3.0 * spacing)
        snapshot = _snapshot(frame, near)
        gauges = [Elevation(name="section", at=tuple(point)) for point in points.tolist()]
        found = np.array([gauge.measure(snapshot)["elevation"] for gauge in gauges])
        found[in_solid(np.column_stack([points, found + 0.5 * spacing]), snapshot)] = np.nan
        rows.append(found)
        times.append(frame.time)
    values = np.array(rows, dtype=float).reshape(len(times), len(points))
    return Diagram("elevation", "m", axis, False, place, np.array(times), values, np.zeros(0), note)


def in_solid(points: NDArray[np.float64], snapshot: Snapshot) -> NDArray[np.bool_]:
    """Return which points lie in a wall or body: behind all faces that are near, or straight below one that looks up.

    Args:
        points: places [m], shape (points, d); one that is NaN is in no wall.
        snapshot: the rows, with ``to_surface``.
    """
    from scipy.spatial import cKDTree

    inside = np.zeros(len(points), dtype=bool)
    to_surface = np.asarray(snapshot["to_surface"], dtype=float)
    length = np.linalg.norm(to_surface, axis=1)
    solid = ~snapshot.fluid & (length > 0.0)
    asked = np.flatnonzero(np.isfinite(points).all(axis=1))
    if not len(asked) or not solid.any():
        return inside
    l0 = snapshot.spacing
    position, normal = np.asarray(snapshot["position"], dtype=float)[solid], to_surface[solid] / length[solid, None]
    _, near = cKDTree(position).query(points[asked], k=min(_NEAREST, len(position)))
    near = near.reshape(len(asked), -1)
    depth = np.einsum("ijk,ijk->ij", (position + to_surface[solid])[near] - points[asked, None], normal[near])
    inside[asked] = np.all(depth > 0.25 * l0, axis=1)
    # A large body is hollow, and the floor below it may be the nearest wall.
    level = np.flatnonzero(np.abs(normal[:, -1]) > 0.3)
    height = position[level, -1]
    beside = cKDTree(position[level, :-1]).query_ball_point(points[asked, :-1], 0.5 * l0 * (1.0 + 1e-6), p=np.inf)
    for point, column in zip(asked, beside, strict=True):
        above = [row for row in column if height[row] > points[point, -1]]
        aside = position[level[above], :-1].mean(axis=0) - points[point, :-1] if above else np.inf
        if np.max(np.abs(aside)) < 0.5 * l0 * (1.0 - 1e-6):  # at the side of a body all rows stand on one side
            inside[point] |= bool(normal[level[min(above, key=lambda row: float(height[row]))], -1] > 0.0)
    return inside


def pressure_along(
    frames: Iterable[Frame], first: NDArray[np.float64], last: NDArray[np.float64], spacing: float
) -> Diagram:
    """Return the pressure along a line, measured in every frame as a pressure gauge would.

    Args:
        frames: the frames.
        first, last: ends of the line [m], shape (d,).
        spacing: l0 [m].
    """
    points, place, axis, note = _points(first, last, spacing)
    times, rows = [], []
    for frame in frames:
        position = np.asarray(frame["position"], dtype=float)
        near = _near(position, first, last, 4.0 * spacing)
        snapshot = _snapshot(frame, near)
        kind = np.asarray(snapshot["kind"])
        fluid, wall = np.flatnonzero(kind == FLUID), np.flatnonzero(kind == WALL)
        chosen = np.concatenate([fluid, wall[wet_rows(snapshot, wall, fluid)]])
        x, p = snapshot["position"][chosen], np.asarray(snapshot["pressure"], dtype=float)[chosen]
        rows.append([point_value(point, x, p, len(fluid), spacing) for point in points])
        times.append(frame.time)
    values = np.array(rows, dtype=float).reshape(len(times), len(points))
    vertical = bool(np.allclose(first[:-1], last[:-1]))
    return Diagram("pressure", "Pa", axis, vertical, place, np.array(times), values, np.zeros(0), note)


def _snapshot(frame: Frame, rows: NDArray[np.intp]) -> Snapshot:
    """Return some rows of a frame as a snapshot."""

    def fetch(name: str) -> NDArray[Any]:
        values: NDArray[Any] = np.asarray(frame[name])[rows]
        return values.astype(float) if values.dtype.kind == "f" else values

    down = [0.0] * (frame.dimension - 1) + [-9.81]  # gauges take the last axis for up, whatever its size
    return Snapshot(
        fetch, time=frame.time, step=frame.index, dt=0.0, spacing=frame.spacing, dimension=frame.dimension, gravity=down
    )


def _near(
    position: NDArray[np.float64], first: NDArray[np.float64], last: NDArray[np.float64], reach: float
) -> NDArray[np.intp]:
    """Return the rows within a distance [m] of the segment between two points."""
    along = last - first
    share = np.clip((position - first) @ along / (along @ along), 0.0, 1.0)
    away = position - first - share[:, None] * along
    return np.flatnonzero(np.einsum("ij,ij->i", away, away) < reach**2)


def _points(
    first: NDArray[np.float64], last: NDArray[np.float64], spacing: float
) -> tuple[NDArray[np.float64], NDArray[np.float64], str, str]:
    """Return points of a segment, about l0 apart, their coordinate, its name, and where the segment is."""
    length = float(np.linalg.norm(last - first))
    count = int(np.clip(np.ceil(length / spacing) + 1, 2, _PLACES))
    points = first + np.linspace(0.0, 1.0, count)[:, None] * (last - first)
    place, axis, note = _along(points)
    return points, place, axis, note


def _along(points: NDArray[np.float64]) -> tuple[NDArray[np.float64], str, str]:
    """Return the coordinate of points of a line, its name, and where the line is."""
    along = points[-1] - points[0]
    moving = np.flatnonzero(np.abs(along) > 1e-9 * np.abs(along).max())
    if len(moving) > 1:
        ends = " to ".join("(" + ", ".join(f"{v:g}" for v in point) + ")" for point in (points[0], points[-1]))
        return np.linalg.norm(points - points[0], axis=1), "s", f"from {ends} m"
    k = int(moving[0])
    fixed = [f"{'xyz'[i]} = {points[0][i]:g} m" for i in range(points.shape[1]) if i != k]
    return points[:, k], "xyz"[k], f"at {', '.join(fixed)}" if fixed else ""
