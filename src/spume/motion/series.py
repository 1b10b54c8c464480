"""Motion from a table of measured or computed positions."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr
from typing_extensions import override

from spume.motion.base import Motion
from spume.named import File, nearest_match
from spume.tables import bare, line_of_row, read_csv

_UNITS = {"time": "s", "x": "m", "y": "m", "z": "m", "angle_deg": "deg"}
_WIDE = 10.0  # a gap is this many times the median distance of two instants


class Series(Motion, name="series"):
    """Displacement and angle at the instants of a CSV file, joined by a cubic spline or by straight lines.

    The columns are ``time [s]``, any of ``x [m]``, ``y [m]``, ``z [m]`` and ``angle_deg [deg]``; what has no
    column does not move. The values count from that at `start`. A spline has a continuous acceleration,
    which a tank's frame needs and which a smooth motion has; straight lines are for tables with corners,
    which a spline would overshoot; their corners are impacts. The file must cover the run.
    """

    file: File
    """CSV file, times from zero and increasing."""
    interpolation: Literal["spline", "linear"] = "spline"
    """Curve between the instants."""
    largest_gap: Annotated[float, Field(gt=0.0)] | None = None
    """Largest time between two instants [s]; default: ten times the median one."""

    _table: _Table = PrivateAttr()

    @override
    def model_post_init(self, context: Any) -> None:
        names, numbers = read_csv(self.file)
        columns = _columns(self.file, names)
        times = numbers[:, 0]
        steps = np.diff(times)
        if len(times) < 2:
            raise ValueError(f"{self.file}: one instant; a motion needs two or more")
        if np.any(steps <= 0.0):
            row = int(np.argmax(steps <= 0.0)) + 1
            place = f"{self.file}:{line_of_row(self.file, row)}"
            raise ValueError(f"{place}: time {times[row]:g} s stands after {times[row - 1]:g} s; times must increase")
        widest = _WIDE * float(np.median(steps)) if self.largest_gap is None else self.largest_gap
        if np.any(steps > widest * (1.0 + 1e-9)):
            row = int(np.argmax(steps)) + 1
            place = f"{self.file}:{line_of_row(self.file, row)}"
            raise ValueError(
                f"{place}: a gap of {steps.max():g} s before {times[row]:g} s; at most {widest:g} s is allowed: fill "
                "it, or set largest_gap"
            )
        if times[0] > 0.0:
            raise ValueError(f"{self.file}: begins at {times[0]:g} s; it must begin at 0 s or before")
        self._table = _Table(columns, numbers, self.interpolation)

    @property
    @override
    def turns(self) -> bool:
        return "angle_deg" in self._table.columns

    @override
    def problems(self, dimension: int, end: float) -> Iterator[tuple[str, str]]:
        yield from super().problems(dimension, end)
        last = self.start + float(self._table.numbers[-1, 0])
        if last < end * (1.0 - 1e-9):
            yield "file", f"ends at {last:g} s, before the motion does ({end:g} s): it must cover the run"
        if dimension == 2 and "z" in self._table.columns:
            yield "file", "has a column z; the case has dimension = 2"

    @override
    def coordinates(self, t: float, order: int = 0) -> tuple[NDArray[np.float64], float]:
        return self._table.at(t, order)


def _columns(file: Path, names: list[str]) -> tuple[str, ...]:
    """Return the columns' bare names, after checking them and their units."""
    allowed = "time [s], x [m], y [m], z [m], angle_deg [deg]"
    columns = tuple(bare(name) for name in names)
    for name, column in zip(names, columns, strict=True):
        if column not in _UNITS:
            raise ValueError(f"{file}: column {name!r}; allowed: {allowed}{nearest_match(column, _UNITS)}")
        unit = name.partition("[")[2].rstrip("] ").strip()
        if unit not in ("", _UNITS[column]):
            raise ValueError(f"{file}: column {name!r} is in {unit}; it must be in {_UNITS[column]}")
    if columns[0] != "time" or len(columns) < 2 or len(set(columns)) < len(columns):
        raise ValueError(f"{file}: columns {', '.join(names)}; needed: time first, then each once of {allowed}")
    return columns


@dataclass(frozen=True, eq=False)
class _Table:
    """A table of coordinates and the curve through it."""

    columns: tuple[str, ...]
    numbers: NDArray[np.float64]
    interpolation: str

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, _Table):
            return NotImplemented
        same = self.columns == other.columns and self.interpolation == other.interpolation
        return same and np.array_equal(self.numbers, other.numbers)

    def __hash__(self) -> int:
        return hash((self.columns, self.numbers.shape, self.interpolation))

    def at(self, t: float, order: int) -> tuple[NDArray[np.float64], float]:
        """Return displacement and angle, or a derivative, at the time t; constant beyond the ends."""
        times = self.numbers[:, 0]
        clamped = min(max(t, float(times[0])), float(times[-1]))
        if order and clamped != t:
            values = np.zeros(len(self.columns) - 1)
        elif self.interpolation == "spline":
            values = np.asarray(self._spline(clamped, order))
        else:
            values = self._line(clamped, order)
        found = dict(zip(self.columns[1:], values, strict=True))
        angle = math.radians(found.pop("angle_deg", 0.0))
        if not found:
            return np.empty(0), angle
        axes = "xyz" if "z" in found else "xy"
        return np.array([found.get(axis, 0.0) for axis in axes]), angle

    def _line(self, t: float, order: int) -> NDArray[np.float64]:
        times, values = self.numbers[:, 0], self.numbers[:, 1:]
        k = min(int(np.searchsorted(times, t, side="right")) - 1, len(times) - 2)
        slope = (values[k + 1] - values[k]) / (times[k + 1] - times[k])
        found: NDArray[np.float64] = (values[k] + slope * (t - times[k]), slope, 0.0 * slope)[order]
        return found

    @cached_property
    def _spline(self) -> Any:
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.numbers[:, 0], self.numbers[:, 1:])
