"""What the page plots: series of runs, references and budgets, as plain data that ``charts.js`` hands to Plotly."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume.outputs.reference import Reference, common_shift, simulated
from spume.report.particles import Overview
from spume.report.tables import momentum_unit, typeset
from spume.results import Results, RunFolderError

LARGEST_POINTS = 3000
"""Points of a line at most; beyond, the smallest and the largest value of every interval are kept."""

_MARKERS = 80  # a reference with fewer points is drawn as points


def thinned(
    x: NDArray[np.float64], y: NDArray[np.float64], largest: int = LARGEST_POINTS
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return at most about so many points of a line, the extremes of every interval among them.

    Args:
        x, y: the line, shape (points,); y may hold NaN.
        largest: number of points to keep.
    """
    if len(x) <= largest:
        return x, y
    edges = np.linspace(0, len(x), largest // 2 + 1).astype(int)
    kept = [0, len(x) - 1]
    for a, b in itertools.pairwise(edges):
        part = y[a:b]
        if np.all(np.isnan(part)):
            kept.append(a)
        else:
            kept += [a + int(np.nanargmin(part)), a + int(np.nanargmax(part))]
    rows = np.unique(kept)
    return x[rows], y[rows]


def line(label: str, x: NDArray[Any], y: NDArray[Any], colour: int = 0, dash: int = 0, **more: Any) -> dict[str, Any]:
    """Return a line of a chart through points of shape (n,); `colour` and `dash` are numbers in the page's lists."""
    x, y = thinned(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
    return {"label": label, "x": _listed(x), "y": _listed(y), "colour": colour, "dash": dash, "kind": "line"} | more


def chart(name: str, title: str, x: str, y: str, lines: list[dict[str, Any]], **more: Any) -> dict[str, Any]:
    """Return a chart; x and y are labels with units."""
    return {"name": name, "title": title, "x": x, "y": y, "lines": lines} | more


def gauge_charts(runs: Sequence[Results], labels: Sequence[str]) -> list[dict[str, Any]]:
    """Return the charts of all gauges, one per gauge and unit; gauges of one name share a chart.

    A gauge with references is shown as the comparison has it: in the units of the reference, moved by the common
    time shift that was found.
    """
    names = list(dict.fromkeys(name for run in runs for name in run.gauge_names))
    made = []
    shifts = [_shift(run) for run in runs]
    for name in names:
        having = [index for index, run in enumerate(runs) if name in run.gauge_names]
        references = next((found for i in having if (found := [r for r in runs[i].references if r.gauge == name])), [])
        if references:
            made.append(_against(name, references, runs, labels, having, shifts))
        else:
            made += _alone(name, runs, labels, having)
    return [c for c in made if c["lines"]]


def _shift(run: Results) -> float:
    try:
        return common_shift([(r, r.load(), simulated(r, run.path)) for r in run.references]) if run.references else 0.0
    except ValueError:
        return 0.0


def _alone(name: str, runs: Sequence[Results], labels: Sequence[str], having: list[int]) -> list[dict[str, Any]]:
    by_unit: dict[str, list[dict[str, Any]]] = {}
    quantities: dict[str, list[str]] = {}
    for index in having:
        columns, units = _columns(runs[index], name)
        for number, (column, values) in enumerate((c, v) for c, v in columns.items() if c != "time"):
            if not np.any(np.isfinite(values)):
                continue
            unit = units[column]
            words = column.replace("_", " ")
            quantities.setdefault(unit, [])
            if words not in quantities[unit]:
                quantities[unit].append(words)
            several = len(runs) > 1
            colour, dash = (index, quantities[unit].index(words)) if several else (number, 0)
            label = f"{labels[index]}, {words}" if several else words
            by_unit.setdefault(unit, []).append(line(label, columns["time"], values, colour, dash))
    made: list[dict[str, Any]] = []
    for unit, lines in by_unit.items():
        quantity = quantities[unit][0] if len(quantities[unit]) == 1 else ""
        if quantity and len(runs) > 1:
            for item in lines:
                item["label"] = item["label"].rpartition(", ")[0]
        suffix = f" {len(made) + 1}" if len(by_unit) > 1 else ""
        title = name.replace("_", " ") + (f": {quantity}" if quantity and len(by_unit) > 1 else "")
        made.append(chart(f"gauge {name}{suffix}", title, "t [s]", f"{quantity} [{typeset(unit)}]".strip(), lines))
    return made


def _against(
    name: str, references: list[Reference], runs: Sequence[Results], labels: Sequence[str], having: list[int],
    shifts: list[float],
) -> dict[str, Any]:  # fmt: skip
    lines: list[dict[str, Any]] = []
    end = 0.0
    for number, reference in enumerate(references):
        series = reference.load()
        source = reference.source or "measured"
        if series.lower is not None and series.upper is not None:
            band = {"label": "band of repeated experiments", "x": _listed(series.time), "kind": "band"}
            lines.append(band | {"lower": _listed(series.lower), "upper": _listed(series.upper)})
        points = len(series.time) < _MARKERS
        lines.append(line(source, series.time, series.value, number, kind="points" if points else "measured"))
        for index in having:
            try:
                run = simulated(reference, runs[index].path)
            except ValueError:
                continue
            moved = shifts[index] / reference.time_scale if reference.shift_max > 0.0 else 0.0
            end = max(end, float(run.time[-1] + moved) if len(run.time) else 0.0)
            label = labels[index] if len(runs) > 1 else "Spume"
            label += f", {reference.value}" if len(references) > 1 and reference.value else ""
            label += f" (moved by {moved:+.2g})" if moved else ""
            lines.append(line(label, run.time + moved, run.value, index if len(runs) > 1 else number, number))
    first = references[0]
    more: dict[str, Any] = {"windows": [list(r.window) for r in references if r.window is not None][:1]}
    more |= {"end": end} if end > 0.0 else {}
    label = first.label or name
    return chart(f"gauge {name}", name.replace("_", " "), first.time_label, label, lines, **more)


def budget_charts(runs: Sequence[Results], labels: Sequence[str], seen: Sequence[Overview | None]) -> list[Any]:
    """Return the charts of volume, energy and momentum."""
    volume, energy, momentum = [], [], []
    several = len(runs) > 1
    units = {"volume": "", "kinetic_energy": "", "momentum": ""}
    for index, run in enumerate(runs):
        columns, found = _columns(run, None)
        prefix = f"{labels[index]}, " if several else ""
        if {"time", "volume"} <= columns.keys():
            units["volume"] = found["volume"]
            volume.append(line(labels[index] if several else "volume", columns["time"], columns["volume"], index))
        if {"time", "kinetic_energy", "potential_energy"} <= columns.keys():
            units["kinetic_energy"] = found["kinetic_energy"]
            kinetic, potential = columns["kinetic_energy"], columns["potential_energy"]
            for number, (label, values) in enumerate(
                (("total", kinetic + potential), ("kinetic", kinetic), ("potential", potential))
            ):
                colour, dash = (index, number) if several else (number, 0)
                energy.append(line(prefix + label, columns["time"], values, colour, dash))
        overview = seen[index]
        if overview is not None:
            units["momentum"] = momentum_unit(run)
            for number, axis in enumerate("xyz"[: run.dimension]):
                if f"momentum_{axis}" in overview.series:
                    colour, dash = (index, number) if several else (number, 0)
                    values = overview.series[f"momentum_{axis}"]
                    momentum.append(line(f"{prefix}along {axis}", overview.times, values, colour, dash))
    made = [
        chart("volume", "Volume of the fluid", "t [s]", f"volume [{typeset(units['volume'])}]", volume),
        chart("energy", "Energy of the fluid", "t [s]", f"energy [{units['kinetic_energy']}]", energy),
        chart("momentum", "Momentum of the fluid", "t [s]", f"momentum [{units['momentum']}]", momentum),
    ]
    return [c for c in made if c["lines"]]


def solver_charts(runs: Sequence[Results], labels: Sequence[str], seen: Sequence[Overview | None]) -> list[Any]:
    """Return the charts of iterations, residual, time step and extremes, where the log has them."""
    wanted: tuple[tuple[str, str, str, dict[str, Any]], ...] = (
        ("iterations", "Pressure iterations", "iterations per step [1]", {}),
        ("residual", "Residual of the pressure equation", "relative residual [1]", {"log": True}),
        ("dt", "Time step", "time step [s]", {}),
    )
    made = []
    for column, title, label, more in wanted:
        lines = []
        for index, run in enumerate(runs):
            columns, _ = _columns(run, None)
            if {"time", column} <= columns.keys():
                lines.append(line(labels[index], columns["time"], columns[column], index))
        made.append(chart(column, title, "t [s]", label, lines, **more))
    for name, title, label in (
        ("speed_max", "Largest speed", "speed [m/s]"),
        ("pressure_max", "Largest pressure", "pressure [Pa]"),
    ):
        lines = [
            line(labels[index], overview.times, overview.series[name], index)
            for index, overview in enumerate(seen)
            if overview is not None and name in overview.series
        ]
        made.append(chart(name, f"{title} of all fluid particles, in the frames", "t [s]", label, lines))
    return [c for c in made if c["lines"]]


def limiter_chart(runs: Sequence[Results], labels: Sequence[str]) -> list[Any]:
    """Return the chart of how often limiters acted until a time, where any did."""
    lines = []
    for index, run in enumerate(runs):
        columns, _ = _columns(run, None)
        counts = [n for n in (run.summary.get("counts") or {}) if n in columns and columns[n].any()]
        for number, name in enumerate(counts):
            label = f"{labels[index]}, {name}" if len(runs) > 1 else name
            colour, dash = (index, number) if len(runs) > 1 else (number, 0)
            lines.append(line(label, columns["time"], np.cumsum(columns[name]), colour, dash))
    made = chart("limiters", "Uses of limiters until then", "t [s]", "uses [1]", lines)
    return [made] if lines else []


def _columns(run: Results, name: str | None) -> tuple[dict[str, NDArray[np.float64]], dict[str, str]]:
    try:
        return run.columns(name)
    except RunFolderError as error:
        note = str(error)
        if note not in run.problems:
            run.problems.append(note)
        return {}, {}


def _listed(values: NDArray[np.float64]) -> list[float | None]:
    return [float(v) if np.isfinite(v) else None for v in values]
