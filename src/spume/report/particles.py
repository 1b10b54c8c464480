"""The particles of a run for the page's animation, and what can be said of all of them in every frame."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume.outputs import frames as frame_file
from spume.outputs import vtkhdf
from spume.report.packed import Packed
from spume.report.sample import even, extremes, rows_of, some_frames
from spume.results import Results

_WALL_SHARE = 0.3  # of the particles shown, at most
_QUANTILES = (0.0005, 0.9995)  # of the fluid's coordinates: what the window shows at first
_COLOURED = (0.01, 0.99)  # of the values: ends of the colour scale
_SAMPLED = 2000  # rows of a frame that count for the ends of the colour scale
_LEVELS = 250.0  # steps between the ends of the colour scale
_FINENESS = 32.0  # steps of a position per distance of the particles shown


@dataclass
class Overview:
    """What all fluid rows of a run do in the frames that are shown.

    Attributes:
        frames: numbers of the frames, of those that can be read.
        times: t [s], shape (frames,).
        series: name to one number per frame: ``speed_max``, ``pressure_min``, ``pressure_max``, ``momentum_x`` …
        extreme_ids: identity numbers of the rows that hold an extreme value in a frame, ascending.
        records: name to the extreme over all frames: value, time, place.
        lower, upper: corners of what the window shows at first [m].
        ranges: name to the ends of the colour scale.
        fluid_ids, wall_ids: identity numbers of all such rows, ascending, shape (rows,).
        fluid_first, wall_first: their first positions [m], shape (rows, d).
        unreadable: frames that cannot be read.
    """

    frames: NDArray[np.int64]
    times: NDArray[np.float64]
    series: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    extreme_ids: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    records: dict[str, dict[str, Any]] = field(default_factory=dict)
    lower: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    upper: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    ranges: dict[str, tuple[float, float]] = field(default_factory=dict)
    fluid_ids: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    fluid_first: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))
    wall_ids: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    wall_first: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 0)))
    unreadable: int = 0


def values_of(frame: vtkhdf.Frame, rows: NDArray[Any]) -> dict[str, NDArray[np.floating]]:
    """Return what a page can colour these rows by: ``pressure`` [Pa], ``speed`` [m/s], each of shape (rows,)."""
    found: dict[str, NDArray[np.floating]] = {}
    if "pressure" in frame:
        found["pressure"] = frame["pressure"][rows]
    if "velocity" in frame:
        found["speed"] = np.linalg.norm(frame["velocity"][rows], axis=1)
    return found


class _Rows:
    """Identity numbers seen so far and where each was first."""

    def __init__(self, dimension: int) -> None:
        self.ids = np.zeros(0, dtype=np.int64)
        self.first = np.zeros((0, dimension))

    def see(self, ids: NDArray[np.int64], position: NDArray[np.floating]) -> None:
        if len(ids) == len(self.ids) and np.array_equal(ids, self.ids):
            return
        _, known = rows_of(self.ids)(ids)
        merged = np.concatenate([self.ids, ids[~known]])
        order = np.argsort(merged, kind="stable")
        self.ids, self.first = merged[order], np.concatenate([self.first, position[~known]])[order]


def survey(run: Results, largest_frames: int) -> Overview:
    """Look at all rows of at most so many frames of a run.

    Raises:
        OSError, KeyError, ValueError: the file of frames cannot be read at all.
    """
    wanted = some_frames(len(run), largest_frames)
    densities = [float(t.get("density", "nan")) for t in run.document.get("fluid", []) if isinstance(t, dict)]
    made = Overview(wanted, run.times[wanted])
    fluid, wall = _Rows(run.dimension), _Rows(run.dimension)
    read: list[int] = []
    extreme: list[NDArray[np.int64]] = []
    corners: list[list[NDArray[np.float64]]] = []
    samples: dict[str, list[NDArray[np.floating]]] = {}
    series: dict[str, list[float]] = {}
    with vtkhdf.Reader(run.path / frame_file.FILE) as reader:
        names = [n for n in ("position", "id", "kind", "velocity", "pressure", "material") if n in reader.fields]
        for number in wanted:
            try:
                frame = reader.read(int(number), names)
            except (OSError, RuntimeError):
                made.unreadable += 1
                continue
            rows = np.flatnonzero(frame.fluid)
            position, ids = frame.position[rows].astype(float), frame["id"][rows]
            solid = np.flatnonzero(frame.wall)
            fluid.see(ids, position)
            wall.see(frame["id"][solid], frame.position[solid].astype(float))
            if len(solid):
                corners.append([frame.position[solid].min(axis=0), frame.position[solid].max(axis=0)])
            if len(rows):
                corners.append([np.quantile(position, q, axis=0) for q in _QUANTILES])
            values = values_of(frame, rows)
            found = extremes(position, values)
            extreme.append(ids[np.unique([row for pair in found.values() for row in pair]).astype(int)])
            _note(made.records, found, frame.time, position, values)
            stride = max(1, len(rows) // _SAMPLED)
            for name, column in values.items():
                samples.setdefault(name, []).append(column[::stride])
            numbers = {f"{n}_min": float(values[n][found[n][0]]) if n in found else np.nan for n in values}
            numbers |= {f"{n}_max": float(values[n][found[n][1]]) if n in found else np.nan for n in values}
            numbers |= _momentum(frame, rows, densities)
            for name, number_ in numbers.items():
                series.setdefault(name, []).append(number_)
            read.append(int(number))
    made.frames, made.times = np.array(read, dtype=np.int64), run.times[np.array(read, dtype=np.int64)]
    made.series = {name: np.array(column) for name, column in series.items() if len(column) == len(read)}
    made.extreme_ids = np.unique(np.concatenate(extreme)) if extreme else made.extreme_ids
    made.fluid_ids, made.fluid_first, made.wall_ids, made.wall_first = fluid.ids, fluid.first, wall.ids, wall.first
    everything = np.array(corners) if corners else np.zeros((1, 2, run.dimension))
    made.lower, made.upper = everything[:, 0].min(axis=0), everything[:, 1].max(axis=0)
    made.ranges = {name: _scale(name, np.concatenate(parts)) for name, parts in samples.items()}
    return made


def _note(
    records: dict[str, dict[str, Any]],
    found: dict[str, tuple[int, int]],
    time: float,
    position: NDArray[np.float64],
    values: dict[str, NDArray[np.floating]],
) -> None:
    """Keep the smallest and the largest value so far, with time and place."""
    for name in values:
        if name not in found:
            continue
        for which, row, beats in (("smallest", found[name][0], np.less), ("largest", found[name][1], np.greater)):
            value, key = float(values[name][row]), f"{which} {name}"
            if key not in records or beats(value, records[key]["value"]):
                records[key] = {"value": value, "time": time, "place": [float(x) for x in position[row]]}


def _momentum(frame: vtkhdf.Frame, rows: NDArray[np.int64], densities: list[float]) -> dict[str, float]:
    """Return the components of the momentum of the fluid, Σ ρ l0^d u, where densities and velocities are known."""
    if "velocity" not in frame or not densities or not np.all(np.isfinite(densities)):
        return {}
    index = frame["material"][rows].astype(int) if "material" in frame else np.zeros(len(rows), dtype=int)
    if len(index) and (index.max() >= len(densities) or index.min() < 0):
        return {}
    mass = np.array(densities)[index] * frame.spacing**frame.dimension
    total = mass @ frame["velocity"][rows].astype(float)
    return {f"momentum_{axis}": float(p) for axis, p in zip("xyz", total, strict=False)}


def _scale(name: str, values: NDArray[np.floating]) -> tuple[float, float]:
    values = values[np.isfinite(values)]
    low, high = (float(np.quantile(values, q)) for q in _COLOURED) if len(values) else (0.0, 1.0)
    if name == "speed" or (low >= -0.05 * high and high > 0.0):
        low = 0.0
    return (low, high) if high > low else (low, low + (abs(low) or 1.0))


def shown_ids(seen: Overview, spacing: float, count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the identity numbers, shape (rows,), of the fluid and of the wall rows to show, at most `count`.

    Every row that holds an extreme value in a frame is among them.
    """
    rows, walls = len(seen.fluid_ids), len(seen.wall_ids)
    for_walls = walls if rows + walls <= count else min(walls, max(int(_WALL_SHARE * count), count - rows))
    wall = seen.wall_ids[even(seen.wall_first, spacing, for_walls)]
    left = count - len(wall)
    if rows <= left:
        return seen.fluid_ids, wall
    spread = even(seen.fluid_first, spacing, max(left - len(seen.extreme_ids), 0))
    return np.union1d(seen.fluid_ids[spread], seen.extreme_ids), wall


def packed(run: Results, seen: Overview, count: int, stride: int = 1) -> tuple[dict[str, Any], Packed]:
    """Return what the page's animation needs to know, and the numbers of the particles.

    Args:
        run: the run.
        seen: all rows, from `survey`.
        count: largest number of particles.
        stride: take every n-th frame, and the last.
    """
    taken = np.unique(np.append(np.arange(0, len(seen.frames), stride), len(seen.frames) - 1))
    numbers, times = seen.frames[taken], seen.times[taken]
    fluid_ids, wall_ids = shown_ids(seen, run.spacing, count)
    fluid, wall = _gathered(run, numbers, fluid_ids, wall_ids)
    stream = Packed()
    d = run.dimension
    groups = {}
    for name, ids, every, arrays in (
        ("fluid", fluid_ids, len(seen.fluid_ids), fluid), ("wall", wall_ids, len(seen.wall_ids), wall),
    ):  # fmt: skip
        if not len(ids):
            continue
        thinned = (every / len(ids)) ** (1.0 / (d if name == "fluid" else d - 1))
        distance = run.spacing * thinned
        gaps = np.diff(ids, prepend=ids[0])  # the page adds them up
        channels = {"gap": stream.add(gaps[None, :], 1.0, 0.0)} if gaps.max() < 2**16 else {}
        for key, values in arrays.items():
            step = {"x": distance / _FINENESS, "y": distance / _FINENESS, "z": distance / _FINENESS}.get(key, 1.0)
            if key in seen.ranges:
                low, high = seen.ranges[key]
                step = (high - low) / _LEVELS
            elif key.startswith("normal"):
                step = 1.0 / 100.0
            channels[key] = stream.add(values, step)
        groups[name] = {
            "rows": len(ids), "all": every, "first_id": int(ids[0]), "distance": distance, "channels": channels,
        }  # fmt: skip
    known = {
        "dimension": d,
        "spacing": run.spacing,
        "times": [float(f"{t:.9g}") for t in times],
        "frames": [int(n) for n in numbers],
        "all_frames": len(run),
        "lower": seen.lower.tolist(),
        "upper": seen.upper.tolist(),
        "ranges": {name: list(ends) for name, ends in seen.ranges.items()},
        "groups": groups,
    }
    return known, stream


def _gathered(
    run: Results, numbers: NDArray[np.int64], fluid_ids: NDArray[np.int64], wall_ids: NDArray[np.int64]
) -> tuple[dict[str, NDArray[Any]], dict[str, NDArray[Any]]]:
    """Return the channels of the fluid and of the wall rows, name to array, shape (frames, rows).

    A row that a frame lacks keeps its numbers from the frame before; the channel ``absent`` is one there.
    """
    axes = "xyz"[: run.dimension]
    fluid: dict[str, NDArray[Any]] = {}
    wall: dict[str, NDArray[Any]] = {}
    with vtkhdf.Reader(run.path / frame_file.FILE) as reader:
        wanted = ("position", "id", "kind", "velocity", "pressure", "material", "free_surface", "to_surface")
        names = [n for n in wanted if n in reader.fields]
        for index, number in enumerate(numbers):
            frame = reader.read(int(number), names)
            find = rows_of(frame["id"])
            rows, there = find(fluid_ids)
            columns: dict[str, NDArray[Any]] = {a: frame.position[rows, k] for k, a in enumerate(axes)}
            columns |= values_of(frame, rows)
            for key in ("material", "free_surface"):
                if key in frame:
                    columns[key] = frame[key][rows]
            _store(fluid, index, len(numbers), columns, there)
            rows, there = find(wall_ids)
            _store(wall, index, len(numbers), _wall_columns(frame, rows, axes), there)
    for group in (fluid, wall):
        if "absent" in group and not group["absent"].any():
            del group["absent"]
    if "material" in fluid and not np.ptp(fluid["material"]):
        del fluid["material"]
    return fluid, wall


def _wall_columns(frame: vtkhdf.Frame, rows: NDArray[np.int64], axes: str) -> dict[str, NDArray[Any]]:
    """Return positions of wall rows; in 3D on the wetted faces, with the direction into the fluid."""
    position = frame.position[rows].astype(float)
    columns: dict[str, NDArray[Any]] = {}
    if frame.dimension == 3 and "to_surface" in frame:
        to_surface = frame["to_surface"][rows].astype(float)
        length = np.linalg.norm(to_surface, axis=1)
        normal = to_surface / np.where(length > 0.0, length, 1.0)[:, None]
        position = position + to_surface
        columns = {f"normal_{a}": np.nan_to_num(normal[:, k]) for k, a in enumerate(axes)}
    return {a: position[:, k] for k, a in enumerate(axes)} | columns


def _store(
    group: dict[str, NDArray[Any]], index: int, count: int, columns: dict[str, NDArray[Any]], there: NDArray[np.bool_]
) -> None:
    for key, values in columns.items():
        if key not in group:
            group[key] = np.zeros((count, len(there)), dtype=np.float32)
        before = group[key][index - 1] if index else np.float32(0.0)
        group[key][index] = np.where(there & np.isfinite(values), values, before)
    group.setdefault("absent", np.zeros((count, len(there)), dtype=np.float32))[index] = ~there
