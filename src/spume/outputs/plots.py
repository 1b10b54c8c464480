"""Plots of gauges, with reference data and their band."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from spume.outputs.reference import Reference, common_shift, simulated
from spume.tables import read_columns

# Okabe & Ito's colours, told apart by everybody.
_SIMULATION = "#0072B2"
_OTHERS = (_SIMULATION, "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
_MEASURED = "#222222"


def plot_gauge(path: Path, file: Path, figure: Any, references: Sequence[Reference] = (), shift: float = 0.0) -> Path:
    """Plot a gauge's columns over time, or against its references; return the picture.

    Args:
        path: the picture.
        file: the gauge's CSV file.
        figure: makes a figure from width, height [inches] and dpi.
        references: what the gauge is compared with.
        shift: common time shift [s] of the references that allow one.
    """
    made = figure(7.2, 4.0, 150)
    axes = made.add_axes((0.11, 0.13, 0.86, 0.76))
    if references:
        _against(axes, references, file.parent.parent, shift)
    else:
        _alone(axes, file)
    axes.set_title(file.stem.replace("_", " "), loc="left", weight="bold", pad=8)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.grid(True, color="#E6E6E6", linewidth=0.7)
    axes.set_axisbelow(True)
    axes.tick_params(length=3, width=0.8)
    made.savefig(path)
    return path


def _alone(axes: Any, file: Path) -> None:
    columns, units = read_columns(file)
    names = [n for n in columns if n != "time"]
    first = units[names[0]]
    same = [n for n in names if units[n] == first]  # one axis holds one unit
    for name, colour in zip(same, _OTHERS, strict=False):
        axes.plot(columns["time"], columns[name], color=colour, linewidth=1.2, label=name.replace("_", " "))
    axes.set_xlabel("t [s]")
    what = same[0].replace("_", " ") if len(same) == 1 else ""
    axes.set_ylabel(f"{what} [{first}]".strip())
    if len(same) > 1:
        axes.legend(frameon=False)
    if len(columns["time"]):
        axes.set_xlim(columns["time"][0], max(columns["time"][-1], columns["time"][0] + 1e-9))


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
