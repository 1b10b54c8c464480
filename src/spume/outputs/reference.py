"""Reference data of a case, and how close the simulation comes to them."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from spume.named import File, Parameters
from spume.outputs.output import Output, RunLike
from spume.outputs.record import path as gauge_path
from spume.tables import line_of_row, read_columns
from spume.terminal import new_console

if TYPE_CHECKING:
    from rich.table import Table

_SHIFTS = 401  # time shifts tried


class Reference(Parameters):
    """A published series that a gauge is compared with.

    Everything is compared, reported and drawn in the units of the reference: a simulated time t
    becomes t / ``time_scale``, a simulated value v becomes v / ``scale``.
    """

    gauge: str
    """Name of the gauge."""
    file: File
    """CSV file with a header line; lines that begin with ``#`` are comments."""
    column: str = ""
    """Column of the value; default: the file's second column."""
    time_column: str = ""
    """Column of the time; default: the file's first column."""
    lower: str = ""
    """Column of the lower edge of the band of repeated experiments."""
    upper: str = ""
    """Column of the upper edge of the band."""
    value: str = ""
    """Column of the gauge that is compared; default: its principal value."""
    time_scale: Annotated[float, Field(gt=0.0)] = 1.0
    """Length of the reference's unit of time [s]."""
    scale: float = 1.0
    """What one unit of the reference's value is in the unit of the gauge [unit of the gauge]."""
    time_label: str = "t [s]"
    """The reference's time and its unit, for tables and pictures."""
    label: str = ""
    """The reference's value and its unit; default: the gauge's."""
    window: tuple[float, float] | None = None
    """Times from and to which errors and peak are taken [unit of the reference]; default: all."""
    threshold: float | None = None
    """Value whose first crossing is the arrival [unit of the reference]; default: a tenth of the range."""
    shift_max: Annotated[float, Field(ge=0.0)] = 0.0
    """Largest time shift allowed [unit of the reference]. One common shift, the one with the smallest
    errors, is applied to all references that allow one (a gate is not instantaneous), and reported."""
    peak_band: tuple[float, float] | None = None
    """Band of the peak over repeated experiments [unit of the reference]; default: that of ``lower`` and ``upper``."""
    source: str = ""
    """Publication, as cited in pictures."""

    @model_validator(mode="after")
    def _check(self) -> Reference:
        if bool(self.lower) != bool(self.upper):
            raise ValueError("lower and upper: give both columns of the band or none")
        if self.scale == 0.0:
            raise ValueError("scale = 0: any other number")
        if self.window is not None and not self.window[0] < self.window[1]:
            raise ValueError(f"window = {list(self.window)}: from a smaller to a larger time")
        return self

    def load(self) -> Series:
        """Return the reference's series.

        Raises:
            ValueError: a column that the file does not have, values that are no finite numbers, times that decrease;
                the message names the line.
        """
        columns, _ = read_columns(self.file)
        names = list(columns)

        def column(key: str, name: str, default: int) -> NDArray[np.float64]:
            if name and name not in columns:
                raise ValueError(f"{self.file}: {key} = {name!r}: one of {', '.join(map(repr, names))}")
            if not name and len(names) <= default:
                raise ValueError(f"{self.file}: {len(names)} column; {key} needs column {default + 1}")
            values = columns[name or names[default]]
            if not np.isfinite(values).all():
                row = int(np.argmin(np.isfinite(values)))
                raise ValueError(
                    f"{self.file}:{line_of_row(self.file, row)}: {name or names[default]} = {values[row]:g}: finite "
                    "numbers are allowed; leave the line out"
                )
            return values

        time = column("time_column", self.time_column, 0)
        if np.any(np.diff(time) < 0.0):
            row = int(np.argmax(np.diff(time) < 0.0)) + 1
            place = f"{self.file}:{line_of_row(self.file, row)}"
            raise ValueError(f"{place}: time {time[row]:g} stands after {time[row - 1]:g}; times must not decrease")
        return Series(
            time,
            column("column", self.column, 1),
            column("lower", self.lower, 1) if self.lower else None,
            column("upper", self.upper, 1) if self.upper else None,
        )


@dataclass(frozen=True)
class Series:
    """A series in time, with the band of repeated experiments where there is one.

    Attributes:
        time: instants, in the reference's unit, shape (instants,).
        value: values there, in the reference's unit, shape (instants,).
        lower, upper: edges of the band, shape (instants,), or None.
    """

    time: NDArray[np.float64]
    value: NDArray[np.float64]
    lower: NDArray[np.float64] | None = None
    upper: NDArray[np.float64] | None = None


@dataclass(frozen=True)
class Comparison:
    """How a gauge compares with its reference, in the reference's units.

    Attributes:
        gauge: name of the gauge.
        label: quantity and unit.
        time_label: time and unit.
        points: reference instants that were compared.
        coverage: share of the reference's instants (in the window) that the run reached.
        shift: time added to the simulation's before errors and peak were taken.
        rms, mean_error, max_error: of simulation − reference; the mean is of the absolute value.
        reference_range: largest minus smallest reference value, for relative errors.
        peak, reference_peak: largest values in the window.
        peak_band: band of the reference's peak.
        peak_in_band: whether ``peak`` lies in it.
        in_band: share of the instants at which the simulation lies in the reference's band.
        arrival, reference_arrival: first crossing of the threshold; the simulation's without shift.
        threshold: the threshold.
        source: publication.
    """

    gauge: str
    label: str
    time_label: str
    points: int
    coverage: float
    shift: float
    rms: float | None
    mean_error: float | None
    max_error: float | None
    reference_range: float
    peak: float | None
    reference_peak: float
    peak_band: tuple[float, float] | None
    peak_in_band: bool | None
    in_band: float | None
    arrival: float | None
    reference_arrival: float | None
    threshold: float
    source: str

    def to_json(self) -> dict[str, Any]:
        """Return the numbers as JSON takes them."""
        return json.loads(json.dumps(asdict(self)))


def first_crossing(time: NDArray[np.float64], value: NDArray[np.float64], threshold: float) -> float | None:
    """Return when a series, shape (instants,), first crosses a threshold from where it begins; None if never."""
    good = np.isfinite(value)
    time, value = time[good], value[good]
    if len(value) == 0:
        return None
    beyond = value >= threshold if value[0] < threshold else value <= threshold
    where = np.flatnonzero(beyond)
    if len(where) == 0:
        return None
    i = int(where[0])
    if i == 0:
        return float(time[0])
    step = value[i] - value[i - 1]
    share = 1.0 if step == 0.0 else (threshold - value[i - 1]) / step
    return float(time[i - 1] + share * (time[i] - time[i - 1]))


def compare(references: Sequence[Reference], folder: Path) -> list[Comparison]:
    """Compare the gauges of a run folder with their references, in the order given.

    Raises:
        ValueError: a gauge has no file, or a column is not there.
    """
    pairs = [(r, r.load(), simulated(r, folder)) for r in references]
    seconds = common_shift(pairs)
    return [_compare(r, series, run, seconds) for r, series, run in pairs]


def simulated(reference: Reference, folder: Path) -> Series:
    """Return a gauge's series from a run folder, in the reference's units and without time shift.

    Raises:
        ValueError: the gauge does not measure what the reference is compared with.
    """
    file = gauge_path(folder, reference.gauge)
    columns, _ = read_columns(file)
    names = [n for n in columns if n != "time"]
    name = reference.value or names[0]
    if name not in names:
        known = ", ".join(map(repr, names))
        raise ValueError(f"reference of gauge {reference.gauge!r}: value = {name!r}: one of {known}")
    return Series(columns["time"] / reference.time_scale, columns[name] / reference.scale)


Pair = tuple[Reference, Series, Series]


def common_shift(pairs: Sequence[Pair]) -> float:
    """Return the time shift [s] with the smallest errors over all references that allow one.

    The sum of (rms / range of the reference)² is made smallest over the shifts that every one of
    them allows; it is added to the simulated times.
    """
    shifting = [(r, series, run) for r, series, run in pairs if r.shift_max > 0.0]
    if not shifting:
        return 0.0
    bound = min(r.shift_max * r.time_scale for r, _, _ in shifting)
    best, shift = np.inf, 0.0
    for seconds in sorted(np.linspace(-bound, bound, _SHIFTS), key=abs):
        total = 0.0
        for r, series, run in shifting:
            _, error, _ = _errors(r, series, run, seconds / r.time_scale)
            if len(error):
                total += float(np.mean(error**2)) / (_range(series) ** 2 or 1.0)
        if total < best * (1.0 - 1e-12):
            best, shift = total, float(seconds)
    return shift


def _range(series: Series) -> float:
    return float(np.nanmax(series.value) - np.nanmin(series.value)) if len(series.value) else 0.0


def _errors(
    reference: Reference, series: Series, run: Series, shift: float
) -> tuple[NDArray[np.bool_], NDArray[np.float64], int]:
    """Return the reference instants compared, simulation − reference there, and how many were wanted."""
    low, high = reference.window or (-np.inf, np.inf)
    wanted = (series.time >= low) & (series.time <= high) & np.isfinite(series.value)
    good = np.isfinite(run.value)
    if not np.any(good):
        return np.zeros_like(wanted), np.zeros(0), int(wanted.sum())
    t, v = run.time[good] + shift, run.value[good]
    # What lies outside the simulated time by no more than the shift takes the nearest value.
    reached = wanted & (series.time >= run.time[good][0] - 1e-9) & (series.time <= max(t[-1], run.time[good][-1]))
    return reached, np.interp(series.time[reached], t, v) - series.value[reached], int(wanted.sum())


def _compare(reference: Reference, series: Series, run: Series, seconds: float) -> Comparison:
    shift = seconds / reference.time_scale if reference.shift_max > 0.0 else 0.0
    reached, error, wanted = _errors(reference, series, run, shift)
    low, high = reference.window or (-np.inf, np.inf)
    inside = (run.time + shift >= low) & (run.time + shift <= high) & np.isfinite(run.value)
    wanted_mask = (series.time >= low) & (series.time <= high)
    reference_peak = float(np.nanmax(series.value[wanted_mask])) if np.any(wanted_mask) else float("nan")
    peak = float(run.value[inside].max()) if np.any(inside) else None
    band = reference.peak_band
    in_band = None
    if series.lower is not None and series.upper is not None:
        if band is None and np.any(wanted_mask):
            band = (float(series.lower[wanted_mask].max()), float(series.upper[wanted_mask].max()))
        value = series.value[reached] + error
        if len(value):
            in_band = float(np.mean((value >= series.lower[reached]) & (value <= series.upper[reached])))
    size = _range(series)
    threshold = reference.threshold
    if threshold is None:
        threshold = float(np.nanmin(series.value)) + 0.1 * size
    return Comparison(
        gauge=reference.gauge,
        label=reference.label,
        time_label=reference.time_label,
        points=len(error),
        coverage=len(error) / wanted if wanted else 0.0,
        shift=shift,
        rms=float(np.sqrt(np.mean(error**2))) if len(error) else None,
        mean_error=float(np.mean(np.abs(error))) if len(error) else None,
        max_error=float(np.max(np.abs(error))) if len(error) else None,
        reference_range=size,
        peak=peak,
        reference_peak=reference_peak,
        peak_band=band,
        peak_in_band=None if band is None or peak is None else bool(band[0] <= peak <= band[1]),
        in_band=in_band,
        arrival=first_crossing(run.time, run.value, threshold),
        reference_arrival=first_crossing(series.time, series.value, threshold),
        threshold=threshold,
        source=reference.source,
    )


def table(comparisons: Sequence[Comparison]) -> Table:
    """Return the terminal's table of comparisons."""
    from rich.table import Table
    from rich.text import Text

    shift = next((c for c in comparisons if c.shift), None)
    caption = []
    if shift is not None:
        caption.append(f"errors after a common time shift of {shift.shift:+.3g} in {shift.time_label}")
    caption += dict.fromkeys(f"measured: {c.source}" for c in comparisons if c.source)
    made = Table(
        title="Simulation against measurement",
        caption="\n".join(caption) or None,
        caption_justify="left",
        header_style="bold",
    )
    made.add_column("gauge", overflow="fold")
    made.add_column("unit", overflow="fold")
    made.add_column("peak", justify="right", overflow="fold")
    made.add_column("measured", justify="right", overflow="fold")
    made.add_column("arrival", justify="right", overflow="fold")
    made.add_column("measured", justify="right", overflow="fold")
    made.add_column("rms error", justify="right", overflow="fold")
    for c in comparisons:
        measured = _number(c.reference_peak)
        if c.peak_band is not None:
            measured += f" ({_number(c.peak_band[0])}…{_number(c.peak_band[1])})"
        style = "" if c.peak_in_band is None else "green" if c.peak_in_band else "yellow"
        rms = _number(c.rms)
        if c.rms is not None and c.coverage < 0.995:
            rms += f" (over {c.coverage:.0%})"
        made.add_row(
            c.gauge,
            Text(_unit(c.label)),
            Text(_number(c.peak), style=style),
            measured,
            _number(c.arrival),
            _number(c.reference_arrival),
            rms,
        )
    return made


def _unit(label: str) -> str:
    inside = label.partition("[")[2].rstrip("] ")
    return inside or label


def _number(value: float | None) -> str:
    if value is None:
        return "–"
    return f"{value:.3g}" if abs(value) < 1000.0 else f"{value:.0f}"


class Compare(Output):
    """Compares the gauges with the case's references at the end, and prints the table.

    Attributes:
        results: the comparisons, after ``finish``.
    """

    def __init__(self, references: Sequence[Reference], gauges: Sequence[str], quiet: bool = False) -> None:
        for reference in references:
            if reference.gauge not in gauges:
                known = ", ".join(map(repr, gauges)) or "(the case has none)"
                raise ValueError(f"reference: gauge = {reference.gauge!r}: one of {known}")
        self.references = tuple(references)
        self.quiet = quiet
        self.results: list[Comparison] = []

    def start(self, run: RunLike) -> None:
        for reference in self.references:  # a wrong column is an error now, not after an hour
            reference.load()

    def finish(self, run: RunLike) -> None:
        if not self.references:
            return
        self.results = compare(self.references, run.folder)
        if not self.quiet:
            console = getattr(run, "console", None) or new_console()
            console.print(table(self.results))
