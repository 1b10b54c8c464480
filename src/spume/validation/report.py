"""What is left of a validation: the figure of each case, and one report of all of them."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from spume.outputs.disk import replace_text
from spume.validation.study import Measured, Run, Study, in_order

REPORT, REPORT_JSON = "report.md", "report.json"
_POINTS = " (points)"
_LINE_OF_LEGEND = 0.085
"""Height of a line of a legend, as a part of the axes."""


def figure(study: Study, measured: Mapping[Run, Measured], path: Path) -> None:
    """Draw the panels of a study: the curves of all its runs, and what they are compared with."""
    panels = {name: panel for name, panel in study.panels.items() if any(name in m.curves for m in measured.values())}
    if not panels:
        return
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    columns = 1 if len(panels) == 1 else 2
    rows = math.ceil(len(panels) / columns)
    drawn, axes = plt.subplots(rows, columns, figsize=(5.2 * columns, 3.4 * rows), layout="constrained", squeeze=False)
    for axis in axes.ravel()[len(panels) :]:
        axis.set_visible(False)
    for axis, (name, panel) in zip(axes.ravel(), panels.items(), strict=False):
        kinds = list(dict.fromkeys((run.series, run.cells) for run in measured))
        for run, result in measured.items():
            if name in result.curves:
                label = f"{run.series + ', ' if run.series else ''}{study.length} = {run.cells}"
                colour = f"C{kinds.index((run.series, run.cells)) % 10}"
                if run.repeat:
                    axis.plot(*result.curves[name], colour, lw=0.5, alpha=0.5, zorder=1.5)
                else:
                    axis.plot(*result.curves[name], colour, lw=1.0, label=label)
        for label, curve in (panel.reference() if panel.reference else {}).items():
            if label.endswith(_POINTS):
                axis.plot(*curve, "ko", ms=3.5, label=label.removesuffix(_POINTS))
            else:
                axis.plot(*curve, "k--", lw=0.9, label=label)
        if panel.line is not None:
            axis.axhline(panel.line, color="0.5", ls=":", lw=1.0, label="bar")
        axis.set(xlabel=panel.x, ylabel=panel.y, title=name)
        if panel.log:
            axis.set_yscale("log")
        if panel.limits:
            axis.set_ylim(*panel.limits)
        _legend(axis, room=panel.limits is None)
    path.parent.mkdir(parents=True, exist_ok=True)
    drawn.savefig(path, dpi=100)
    plt.close(drawn)


def _legend(axis: Any, *, room: bool) -> None:
    """Add the legend in two columns, where there is ``room`` above the curves, for which the axis is made longer."""
    if not room:
        axis.legend(framealpha=1.0, edgecolor="none", fontsize="small")
        return
    part = _LINE_OF_LEGEND * math.ceil(len(axis.get_legend_handles_labels()[1]) / 2)
    scale = axis.yaxis.get_transform()
    low, high = scale.transform(axis.get_ylim())
    axis.set_ylim(top=scale.inverted().transform(low + (high - low) / (1.0 - part)))
    axis.legend(loc="upper center", ncols=2, frameon=False, fontsize="small")


def write(out: Path) -> None:
    """Write the report of every study that has results in this folder, as Markdown and as JSON."""
    found = [json.loads(path.read_text(encoding="utf-8")) for path in out.glob("*/results.json")]
    every = sorted((r for r in found if "bars" in r and "runs" in r), key=lambda r: in_order(r["number"]))
    replace_text(out / REPORT_JSON, json.dumps(every, indent=2, ensure_ascii=False) + "\n")
    replace_text(out / REPORT, "\n".join(_lines(every, out)).rstrip() + "\n")


def _lines(every: list[dict[str, Any]], out: Path) -> list[str]:
    lines = [
        "# Validation report",
        "",
        "Written by `spume validate`. A bar that does not hold is marked **MISSED**; one that",
    ]
    lines += ["is meant for a finer resolution than was run says so.", ""]
    lines += ["| case | quantity | bar | reached | at | |", "|---|---|---|---|---|---|"]
    for results in every:
        lines += [_bar_row(results, bar) for bar in results["bars"]]
    for results in every:
        lines += ["", f"## {results['number']}: {results['title']}", ""]
        kind = "quick runs" if results["quick"] else "runs"
        lines += [
            f"Reference: {results['reference']}. {kind.capitalize()} of {results['date']}, {results['machine']}.",
            "",
        ]
        lines += _failures(results)
        lines += _runs(results)
        if results["orders"]:
            words = [f"{_series(o)}{o['metric']} {number(o['order'])}" for o in results["orders"]]
            lines += ["", "Observed order of convergence: " + "; ".join(words) + "."]
        if (out / results["case"] / "figure.png").exists():
            lines += ["", f"![{results['title']}]({results['case']}/figure.png)"]
    return lines


def _again(run: dict[str, Any]) -> str:
    return f" ({run['repeat'] + 1})" if run.get("repeat") else ""


def _series(entry: dict[str, Any]) -> str:
    return f"{entry['series']}: " if entry["series"] else ""


def _bar_row(results: dict[str, Any], bar: dict[str, Any]) -> str:
    at = f"{results['length']} = {bar['cells']}" if bar["cells"] else "–"
    if bar["meant for cells"] > bar["cells"]:
        at += f" (meant for {bar['meant for cells']})"
    if bar.get("mean of runs", 1) > 1:
        at += f", mean of {bar['mean of runs']}"
    word = bar["verdict"] if bar["verdict"] != "MISSED" else "**MISSED**"
    word += " (limit of the quick runs, not the bar)" if results["quick"] and word != "not judged" else ""
    name = f"{results['number']} {results['case']}"
    metric = bar["metric"].replace("|", "\\|")
    return f"| {name} | {_series(bar)}{metric} | {limits(bar)} | {number(bar['reached'])} | {at} | {word} |"


def limits(bar: dict[str, Any]) -> str:
    """Return the limits of a bar as text."""
    low, high = bar["lower"], bar["upper"]
    if low is None and high is None:
        return "–"
    if low is None:
        return f"≤ {number(high)}"
    return f"≥ {number(low)}" if high is None else f"{number(low)} … {number(high)}"


def number(value: float | None) -> str:
    """Return a number with three digits; a dash for none."""
    return "–" if value is None else f"{value:.3g}"


def _failures(results: dict[str, Any]) -> list[str]:
    failed = [run for run in results["runs"] if run["status"] not in ("finished", "not run")]
    lines = [f"- **{run['name']} {run['status']}**: {run['reason']}" for run in failed]
    missing = [run["name"] for run in results["runs"] if run["status"] == "not run"]
    lines += [f"- not run: {', '.join(missing)}"] if missing else []
    return [*lines, ""] if lines else []


def _runs(results: dict[str, Any]) -> list[str]:
    """Return the table of runs: a column each."""
    runs = [run for run in results["runs"] if run["status"] == "finished"]
    if not runs:
        return []
    heads = [f"{_series(run)}{results['length']} = {run['cells']}{_again(run)}" for run in runs]
    lines = ["| | " + " | ".join(heads) + " |", "|---|" + "---|" * len(runs)]

    def row(name: str, values: list[Any]) -> None:
        cells = [v if isinstance(v, str) else number(v) for v in values]
        lines.append(f"| {name.replace('|', chr(92) + '|')} | " + " | ".join(cells) + " |")

    for metric in dict.fromkeys(name for run in runs for name in run["metrics"]):
        row(metric, [run["metrics"].get(metric) for run in runs])
    for name in dict.fromkeys(name for run in runs for name in run["budgets"]):
        row(name, [run["budgets"].get(name) for run in runs])
    row("fluid particles; steps", [f"{run['particles_fluid']}; {run['steps']}" for run in runs])
    row(
        "pressure iterations, mean; largest",
        [f"{number(run['pressure_iterations_mean'])}; {run['pressure_iterations_max']}" for run in runs],
    )
    row("wall time per fluid particle and step [µs]", [run["us_per_fluid_particle_step"] for run in runs])
    for name in dict.fromkeys(name for run in runs for name in run["counts"]):
        row(f"uses of a limiter: {name}", [str(run["counts"].get(name, 0)) for run in runs])
    return lines
