"""What a validation case is: runs of built-in cases, a function that measures them, and bars."""

from __future__ import annotations

import importlib
import math
import os
import pkgutil
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from spume.named import nearest_match
from spume.problems import CaseError, Problem

if TYPE_CHECKING:
    from spume.validation.folder import Folder

REFERENCE_DATA = "SPUME_REFERENCE_DATA"
"""Environment variable that names the folder of the full measured series."""

Curve = tuple[NDArray[np.float64], NDArray[np.float64]]
"""Abscissae and ordinates of a line in a figure."""


@dataclass(frozen=True)
class Run:
    """One simulation: a built-in case with keys replaced.

    Attributes:
        case: name of the built-in case.
        cells: resolution, the study's length over l0.
        settings: keys replaced, as for ``--set``; the spacing belongs to them.
        series: what is the same in runs that differ in resolution only, such as ``Re 100``.
        repeat: number of a repetition, which takes steps of another length (see `driver.settings_of`).
    """

    case: str
    cells: int
    settings: tuple[str, ...] = ()
    series: str = ""
    repeat: int = 0

    @property
    def name(self) -> str:
        """Name of the run and of its folder."""
        words = re.findall(r"[a-z0-9.]+", f"{self.series} {self.cells}".lower())
        return "-".join([*words, *([f"repeat-{self.repeat}"] if self.repeat else [])])

    def repeated(self, times: int) -> tuple[Run, ...]:
        """Return this run and its repetitions, ``times`` in all: flows that are chaotic are judged by their mean."""
        return tuple(replace(self, repeat=k) for k in range(times))


@dataclass(frozen=True)
class Measured:
    """What a run came to.

    Attributes:
        metrics: quantity to value, SI or as the quantity's name says.
        curves: panel of the figure to the line that the run gives there.
    """

    metrics: dict[str, float]
    curves: dict[str, Curve] = field(default_factory=dict)


@dataclass(frozen=True)
class Bar:
    """A number to reach.

    Attributes:
        metric: quantity of `Measured.metrics`; ``order: <quantity>`` is its observed order of convergence.
        upper, lower: limits of the value.
        series: runs that are judged; the one with most particles counts, or the mean of its repetitions.
        cells: resolution for which the bar is meant.
        quick: limits (lower, upper) that the coarse runs of ``--quick`` must hold; None judges nothing there.
    """

    metric: str
    upper: float = math.inf
    lower: float = -math.inf
    series: str = ""
    cells: int = 0
    quick: tuple[float, float] | None = None


@dataclass(frozen=True)
class Panel:
    """One set of axes of a study's figure.

    Attributes:
        x, y: labels of the axes.
        log: logarithmic ordinate.
        reference: gives label and line of what is compared with; a line of points where the label ends in ``(points)``.
        line: ordinate of a horizontal line, such as a bar.
        limits: smallest and largest ordinate.
    """

    x: str
    y: str
    log: bool = False
    reference: Callable[[], Mapping[str, Curve]] | None = None
    line: float | None = None
    limits: tuple[float, float] | None = None


@dataclass(frozen=True)
class Study:
    """A validation case.

    Attributes:
        number: of the case.
        title: the case in one line.
        length: what is counted in spacings, such as ``H/l0``.
        reference: what it is compared with, and where that comes from.
        runs: simulations, coarse to fine.
        quick: those of ``--quick``.
        measure: takes the folder of a run.
        bars: what should hold.
        panels: of the figure, by name.
        orders: metrics of which the observed order of convergence is reported.
        name: of the case, that of its file.
    """

    number: str
    title: str
    length: str
    reference: str
    runs: tuple[Run, ...]
    quick: tuple[Run, ...]
    measure: Callable[[Folder], Measured]
    bars: tuple[Bar, ...]
    panels: Mapping[str, Panel] = field(default_factory=dict)
    orders: tuple[str, ...] = ()
    name: str = ""


def studies() -> dict[str, Study]:
    """Return every study by its name, in the order of their numbers."""
    from spume.validation import cases

    found = []
    for entry in pkgutil.iter_modules(cases.__path__):
        study = importlib.import_module(f"{cases.__name__}.{entry.name}").STUDY
        found.append(replace(study, name=entry.name.replace("_", "-")))
    return {study.name: study for study in sorted(found, key=_order)}


def _order(study: Study) -> tuple[int, str]:
    return in_order(study.number)


def in_order(number: str) -> tuple[int, str]:
    """Return what sorts the numbers of cases: 2 before 10, 6a before 6b."""
    digits = re.match(r"\d*", number)
    return int(digits.group() or 0) if digits else 0, number


def chosen(names: Sequence[str]) -> list[Study]:
    """Return the studies of these names or numbers (4 stands for 4a and 4b); all of them without names.

    Raises:
        CaseError: there is no such study; the message lists all of them.
    """
    known = studies()
    if not names:
        return list(known.values())
    found = []
    for name in names:
        mine = [s for s in known.values() if name in (s.name, s.number, s.number.rstrip("abcde"))]
        if not mine:
            every = ", ".join(f"{s.name} ({s.number})" for s in known.values())
            message = f"no such validation case; there are {every}{nearest_match(name, known)}"
            raise CaseError([Problem("", f"case {name!r}", "", message)])
        found += [study for study in mine if study not in found]
    return found


def order(sizes: Sequence[int], errors: Sequence[float]) -> float:
    """Return the observed order of convergence: minus the slope of log(error) over log(size), by least squares."""
    good = [(s, e) for s, e in zip(sizes, errors, strict=True) if e > 0.0 and math.isfinite(e)]
    if len({s for s, _ in good}) < 2:
        return math.nan
    x, y = np.log(np.array(good)).T
    return float(-np.polyfit(x, y, 1)[0])


def rms(values: Iterable[float] | NDArray[np.float64]) -> float:
    """Return the root of the mean square of values of any shape."""
    return float(np.sqrt(np.mean(np.square(np.asarray(values, dtype=float)))))


def rms_over_time(series: Curve, reference: Curve, window: tuple[float, float]) -> float:
    """Return the root of the mean over time of (series - reference)^2, both linear between their points.

    The mean ends where the series does; of a series that ends before the window it is NaN. An rms over the points of
    one of them would count most where its points are closest.
    """
    t, e = _difference(series, reference, window)
    if len(t) < 2:
        return float("nan")
    # The integral of the square of a function that is linear between its points.
    squares = np.diff(t) * (e[1:] ** 2 + e[1:] * e[:-1] + e[:-1] ** 2) / 3
    return float(np.sqrt(squares.sum() / (t[-1] - t[0])))


def mean_over_time(series: Curve, reference: Curve, window: tuple[float, float]) -> float:
    """Return the mean over time of series - reference, as `rms_over_time`."""
    t, e = _difference(series, reference, window)
    if len(t) < 2:
        return float("nan")
    return float((np.diff(t) * (e[1:] + e[:-1]) / 2).sum() / (t[-1] - t[0]))


def _difference(series: Curve, reference: Curve, window: tuple[float, float]) -> Curve:
    """Return the instants of both curves in the window, its ends included, and series - reference at them."""
    begin, end = max(window[0], series[0][0]), min(window[1], series[0][-1])
    t = np.unique(np.concatenate((series[0], reference[0], (begin, end))))
    t = t[(t >= begin) & (t <= end)]
    return t, np.interp(t, *series) - np.interp(t, *reference)


def reference_file(name: str) -> Path | None:
    """Return a file of the full reference series, where ``SPUME_REFERENCE_DATA`` names their folder."""
    folder = os.environ.get(REFERENCE_DATA)
    if not folder:
        return None
    path = Path(folder) / name
    return path if path.is_file() else None


def table(path: Path) -> NDArray[np.float64]:
    """Return the numbers of a CSV file with one line of titles, shape (rows, columns)."""
    return np.genfromtxt(path, delimiter=",", skip_header=1, comments="#", ndmin=2)
