"""The atlas as a figure that is read in one screen, and as tables."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

from spume.outputs.disk import replace_text

FIGURE, PAGE = "atlas.png", "atlas.md"
MEASURES = {
    "error": "error",
    "noise in space": "pressure noise in space",
    "noise in time": "pressure noise in time",
    "volume": "last change of the volume",
    "energy": "last change of the energy over the largest kinetic energy",
    "disorder": "disorder of the particles",
    "iterations": "pressure iterations, mean",
    "cost": "µs per fluid particle and step",
}


def write(results: dict[str, Any], out: Path) -> None:
    """Draw the figure and write the page of tables."""
    figure(results, out / FIGURE)
    replace_text(out / PAGE, "\n".join(_lines(results)).rstrip() + "\n")


def by_place(results: dict[str, Any]) -> dict[tuple[str, str], dict[str, Any]]:
    """Return the runs by combination and problem."""
    return {(run["combination"], run["problem"]): run for run in results["runs"]}


def figure(results: dict[str, Any], path: Path) -> None:
    """Draw the errors: a row for each combination, a column for each problem, coloured by the ratio to the default."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    import numpy as np

    runs = by_place(results)
    names = [c["name"] for c in results["combinations"]]
    problems = [p["name"] for p in results["problems"]]
    blank = {"not run": "–"}
    ratio = np.full((len(names), len(problems)), np.nan)
    for i, name in enumerate(names):
        for k, problem in enumerate(problems):
            mine, usual = (runs[n, problem].get("error") for n in (name, "default"))
            if mine and usual:
                ratio[i, k] = math.log10(mine / usual)
    drawn, axis = plt.subplots(figsize=(9.0, max(3.5, 1.2 + 0.21 * len(names))), layout="constrained")
    colours = plt.get_cmap("RdYlGn_r").with_extremes(bad="0.25")
    image = axis.imshow(np.ma.masked_invalid(ratio), cmap=colours, vmin=-1.0, vmax=1.0, aspect="auto")
    for i, name in enumerate(names):
        for k, problem in enumerate(problems):
            run = runs[name, problem]
            text = _percent(run["error"]) if run.get("error") is not None else blank.get(run["status"], run["status"])
            dark = not np.isfinite(ratio[i, k])
            axis.text(k, i, text, ha="center", va="center", fontsize=7, color="w" if dark else "k")
    axis.set_xticks(range(len(problems)), problems, fontsize=9)
    axis.xaxis.tick_top()
    axis.set_yticks(range(len(names)), names, fontsize=7.5)
    bar = drawn.colorbar(image, ax=axis, ticks=[-1, -0.5, 0, 0.5, 1], shrink=0.5)
    bar.ax.set_yticklabels(["1/10", "1/3", "1", "3", "10"])
    bar.set_label("error / that of the default")
    path.parent.mkdir(parents=True, exist_ok=True)
    drawn.savefig(path, dpi=110)
    plt.close(drawn)


def _percent(value: float) -> str:
    digits = ".2g" if value < 0.995 or value >= 10.0 else ".0f"
    return f"{100.0 * value:{digits}} %" if value < 10.0 else f"{value:{digits}} ×"


def _lines(results: dict[str, Any]) -> list[str]:
    runs = by_place(results)
    lines = ["# The atlas: tables", "", f"Written by `spume atlas` on {results['date']}, {results['machine']}.", ""]
    lines += ["| problem | case | resolution | error | pressure scale |", "|---|---|---|---|---|"]
    lines += [
        f"| {p['name']} | `{p['case']}` | {p['cells']} | {p['error']} | {p['scale']} |" for p in results["problems"]
    ]
    for problem in results["problems"]:
        name = problem["name"]
        measures = [m for m in MEASURES if any(m in runs[c["name"], name] for c in results["combinations"])]
        lines += ["", f"## {name.capitalize()}", "", f"Error: {problem['error']}.", ""]
        lines += ["| models | " + " | ".join(measures) + " |", "|---|" + "---|" * len(measures)]
        for combination in results["combinations"]:
            run = runs[combination["name"], name]
            if run["status"] == "finished":
                cells = [_cell(measure, run.get(measure)) for measure in measures]
            else:
                cells = [f"{run['status']}: {_short(run['reason'])}", *[""] * (len(measures) - 1)]
            lines.append(f"| {combination['name']} | " + " | ".join(cells) + " |")
    return lines


def _cell(measure: str, value: float | None) -> str:
    if value is None:
        return "–"
    if measure in ("iterations", "cost"):
        return f"{value:.3g}"
    return f"{100.0 * value:.3g} %" if abs(value) < 10.0 else f"{value:.3g} ×"


def _short(reason: str | None) -> str:
    """Return the first sentence of a diagnosis, without what would end a cell of the table."""
    text = (reason or "").replace("|", "/").splitlines()[0] if reason else ""
    return text.split("; particle")[0].split(". Likely")[0]
