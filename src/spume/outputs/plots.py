"""Plots of gauges, with reference data and their band."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume.outputs.reference import Reference, common_shift, simulated
from spume.tables import read_columns

# Okabe & Ito's colours, told apart by everybody.
_SIMULATION = "#0072B2"
_OTHERS = (_SIMULATION, "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_MEASURED = "#222222"
_DASHES = ("-", (0, (5, 4)), (0, (1.5, 2.5)))  # a dashed line shows what runs below it
_LINE = 0.006  # width of a line, of the height of an axis

Values = NDArray[np.float64]


def plot_gauge(path: Path, file: Path, figure: Any, references: Sequence[Reference] = (), shift: float = 0.0) -> Path:
    """Plot a gauge's columns over time, one axis a unit, or against its references; return the picture.

    Args:
        path: the picture.
        file: the gauge's CSV file.
        figure: makes a figure from width, height [inches] and dpi.
        references: what the gauge is compared with.
        shift: common time shift [s] of the references that allow one.
    """
    if references:
        made = figure(7.2, 4.0, 150)
        panels = [made.add_axes((0.11, 0.13, 0.86, 0.76))]
        _against(panels[0], references, file.parent.parent, shift)
    else:
        columns, units = read_columns(file)
        by_unit: dict[str, dict[str, Values]] = {}  # one axis holds one unit
        for name in (n for n in columns if n != "time"):
            by_unit.setdefault(units[name], {})[name] = columns[name]
        made, panels = _stacked(figure, len(by_unit))
        for axes, (unit, series) in zip(panels, by_unit.items(), strict=True):
            _alone(axes, columns["time"], series, unit)
        panels[-1].set_xlabel("t [s]")
    panels[0].set_title(file.stem.replace("_", " "), loc="left", weight="bold", pad=8)
    for axes in panels:
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
        axes.grid(True, color="#E6E6E6", linewidth=0.7)
        axes.set_axisbelow(True)
        axes.tick_params(length=3, width=0.8)
    made.align_ylabels(panels)
    made.savefig(path, bbox_inches="tight", pad_inches=0.12)  # numbers may be long
    return path


def _stacked(figure: Any, count: int) -> tuple[Any, list[Any]]:
    """Return a figure and its panels, one above the other, with one axis of time below."""
    below, above, gap = 0.52, 0.44, 0.28  # [inches]
    tall = 3.04 if count == 1 else 2.2
    height = below + count * tall + (count - 1) * gap + above
    made = figure(7.2, height, 150)
    panels = [
        made.add_axes((0.11, (below + number * (tall + gap)) / height, 0.86, tall / height))
        for number in reversed(range(count))
    ]
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)
    return made, panels


def _alone(axes: Any, time: Values, series: Mapping[str, Values], unit: str) -> None:
    for (label, values, dash), colour in zip(told_apart(series), itertools.cycle(_OTHERS), strict=False):
        axes.plot(time, values, color=colour, linewidth=1.2, linestyle=dash, label=label)
    words = [name.replace("_", " ") for name in series]
    first = {word.split()[0] for word in words}
    what = words[0] if len(words) == 1 else first.pop() if len(first) == 1 else ""
    axes.set_ylabel(f"{what} [{unit}]".strip())
    if len(series) > 1:
        axes.legend(frameon=False)
    if len(time):
        axes.set_xlim(time[0], max(time[-1], time[0] + 1e-9))


def told_apart(series: Mapping[str, Values]) -> list[tuple[str, Values, Any]]:
    """Return label, values and dashes of the lines that show series, so that none hides another.

    Series that agree to the width of a line are one line, which names them all; where they agree for a quarter of the
    time the later one is dashed.

    Args:
        series: name to values, shape (instants,).
    """
    finite = np.concatenate([v[np.isfinite(v)] for v in series.values()])
    width = _LINE * float(np.ptp(finite)) if len(finite) else 0.0
    lines: list[tuple[list[str], Values, int]] = []
    for name, values in series.items():
        words = name.replace("_", " ")
        near = [np.isclose(values, v, rtol=0.0, atol=width, equal_nan=True) for _, v, _ in lines]
        twin = next((line for line, agrees in zip(lines, near, strict=True) if agrees.all()), None)
        if twin is not None:
            twin[0].append(words)
            continue
        under = [dash for (_, _, dash), agrees in zip(lines, near, strict=True) if agrees.mean() > 0.25]
        lines.append(([words], values, max(under, default=-1) + 1))
    return [(", ".join(words), values, _DASHES[min(dash, len(_DASHES) - 1)]) for words, values, dash in lines]


def _against(axes: Any, references: Sequence[Reference], folder: Path, shift: float) -> None:
    end = 0.0
    for number, reference in enumerate(references):
        series = reference.load()
        run = simulated(reference, folder)
        moved = shift / reference.time_scale if reference.shift_max > 0.0 else 0.0
        end = max(end, float(run.time[-1]) if len(run.time) else 0.0)
        shown = f" (moved by {moved:+.2g})" if moved else ""
        axes.plot(
            run.time + moved,
            run.value,
            color=_OTHERS[number % len(_OTHERS)],
            linewidth=1.1,
            label=f"Spume{shown}" if len(references) == 1 else f"Spume, {reference.value or number + 1}{shown}",
            zorder=3,
        )
        measured = reference.source or "measured"
        if series.lower is not None and series.upper is not None:
            axes.fill_between(
                series.time, series.lower, series.upper, color="#9AA0A6", alpha=0.45, linewidth=0.0,
                label="band of repeated experiments", zorder=1,
            )  # fmt: skip
        few = len(series.time) < 80
        axes.plot(
            series.time, series.value, color=_MEASURED, linewidth=0.0 if few else 0.9,
            marker="o" if few else "", markersize=3.6, label=measured, zorder=2 if not few else 4,
        )  # fmt: skip
        if reference.window is not None and number == 0:
            for edge in reference.window:
                axes.axvline(edge, color="#888888", linewidth=0.7, linestyle=(0, (3, 3)), zorder=0)
    axes.set_xlabel(references[0].time_label)
    axes.set_ylabel(references[0].label or f"{references[0].gauge}")
    if end > 0.0:
        axes.set_xlim(0.0, end)
    axes.legend(frameon=False, fontsize=8.5)


def plot_gauges(folder: Path, gauge_folder: str, figure: Any, references: Sequence[Reference]) -> list[Path]:
    """Plot every gauge of a run folder next to its CSV file; return the pictures."""
    shift = common_shift([(r, r.load(), simulated(r, folder)) for r in references]) if references else 0.0
    made = []
    for file in sorted((folder / gauge_folder).glob("*.csv")):
        columns, _ = read_columns(file)
        if len(columns) < 2 or not np.any(np.isfinite(next(iter(columns.values())))):
            continue
        mine = [r for r in references if r.gauge == file.stem]
        made.append(plot_gauge(file.with_suffix(".png"), file, figure, mine, shift))
    return made
