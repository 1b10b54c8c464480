"""The page: sections put together with data, style and scripts into one text that needs nothing else."""

from __future__ import annotations

import base64
import importlib.resources
import json
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from spume.report import charts, tables
from spume.report.packed import bytes_text
from spume.report.particles import Overview
from spume.results import Results

GENERATOR = "Spume report"
_SCRIPTS = ("view.js", "player.js", "main.js")
# Okabe & Ito's colours, told apart by everybody.
_CATEGORIES = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#d55e00", "#56b4e9")
_POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
"""Nothing can be fetched, not even by a library that would like to."""


def page(
    runs: Sequence[Results],
    labels: Sequence[str],
    seen: Sequence[Overview | None],
    particles: Sequence[tuple[dict[str, Any], str] | None],
    library: str,
) -> str:
    """Return the page of one run or of a comparison.

    Args:
        runs: the runs.
        labels: what each is called in the page.
        seen: all rows of each run; None where it has no frames that can be read.
        particles: what `particles.packed` says, and its stream as text.
        library: source of plotly.js.
    """
    one = len(runs) == 1
    title = runs[0].title if one else "Comparison of " + ", ".join(labels)
    gauges = charts.gauge_charts(runs, labels)
    budgets = charts.budget_charts(runs, labels, seen)
    solver = charts.solver_charts(runs, labels, seen) + charts.limiter_chart(runs, labels)
    everything = [*gauges, *budgets, *solver]
    sections = [
        (
            "what",
            "What was simulated",
            tables.overview(runs, labels) + ("" if one else tables.differences(runs, labels)),
        ),
        ("particles", "Particles", _particles(runs, labels, seen, particles)),
        ("gauges", "Gauges", tables.comparisons(runs, labels) + _charts(gauges, everything)),
        ("budgets", "Budgets", tables.budgets(runs, labels, seen) + _charts(budgets, everything)),
        ("solver", "Solver", tables.solver(runs, labels) + _charts(solver, everything)),
        ("cost", "Cost", tables.cost(runs, labels)),
        ("case", "Case", _cases(runs, labels)),
        ("environment", "Environment", tables.environment(runs, labels)),
    ]
    sections = [
        (key, head, body or "<p class='note'>The run has written nothing of this.</p>") for key, head, body in sections
    ]
    data = {
        "runs": [
            {"name": label, "path": run.path.name, "status": run.status, "particles": made and made[0]}
            for run, label, made in zip(runs, labels, particles, strict=True)
        ],
        "ranges": _ranges(particles),
        "maps": {"continuous": _map(), "categories": _bytes(_CATEGORIES)},
        "charts": everything,
    }
    streams = "".join(
        f'<script type="text/plain" id="particles-{index}">{made[1]}</script>\n'
        for index, made in enumerate(particles)
        if made is not None
    )
    links = "".join(f'<li><a href="#{key}">{head}</a></li>' for key, head, _ in sections)
    body = "".join(
        f'<section id="{key}" aria-labelledby="{key}-head"><h2 id="{key}-head">{head}</h2>{text}</section>\n'
        for key, head, text in sections
    )
    return f"""<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="generator" content="{GENERATOR}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{_POLICY}">
<link rel="icon" href="data:,">
<title>{escape(title)}</title>
<style>
{_own("page.css")}</style>
</head>
<body>
<header><h1>{escape(title)}</h1>{_status(runs, labels)}</header>
<nav aria-label="Sections"><ul>{links}</ul></nav>
<main>
<div id="trouble" role="alert" hidden></div>
{body}</main>
<footer>{_footer(runs)}</footer>
<script type="application/json" id="report">{_json(data)}</script>
{streams}<script type="text/plain" id="plotly">{bytes_text(library.encode("utf-8"))}</script>
<script>
{"".join(_own(name) for name in _SCRIPTS)}</script>
</body>
</html>
"""


def _footer(runs: Sequence[Results]) -> str:
    versions = sorted({str(run.summary["version"]) for run in runs if run.summary.get("version")})
    computed = f", computed with Spume {' and '.join(versions)}" if versions else ""
    return escape(f"Made by Spume from the files of {', '.join(run.path.name for run in runs)}{computed}.")


def _own(name: str) -> str:
    return importlib.resources.files("spume.report").joinpath(name).read_text(encoding="utf-8")


def _json(data: Any) -> str:
    # "</script>" inside would end the element.
    return json.dumps(data, allow_nan=False, separators=(",", ":"), ensure_ascii=False).replace("<", "\\u003c")


def _status(runs: Sequence[Results], labels: Sequence[str]) -> str:
    texts = []
    for run, label in zip(runs, labels, strict=True):
        reason = run.summary.get("reason")
        name = "" if len(runs) == 1 else f"{escape(label)}: "
        texts.append(
            f'<p>{name}<span class="status {escape(run.status)}">{escape(run.status)}</span>'
            f"{' ' + escape(str(reason)) if reason else ''}</p>"
        )
        if run.problems:
            items = "".join(f"<li>{escape(problem)}</li>" for problem in dict.fromkeys(run.problems))
            texts.append(f'<div class="problems">What this folder lacks:<ul>{items}</ul></div>')
    return "".join(texts)


def _ranges(particles: Sequence[tuple[dict[str, Any], str] | None]) -> dict[str, list[float]]:
    """Return the ends of the colour scales that all runs share."""
    ranges: dict[str, list[float]] = {}
    for made in particles:
        for name, (low, high) in {} if made is None else made[0]["ranges"].items():
            ends = ranges.setdefault(name, [low, high])
            ends[0], ends[1] = min(ends[0], low), max(ends[1], high)
    return ranges


def _particles(
    runs: Sequence[Results],
    labels: Sequence[str],
    seen: Sequence[Overview | None],
    particles: Sequence[tuple[dict[str, Any], str] | None],
) -> str:
    figures, channels, notes = [], set(), []
    for index, made in enumerate(particles):
        if made is None:
            if len(runs) > 1:
                notes.append(f"{labels[index]}: no frames that can be shown")
            continue
        known = made[0]
        size = [b - a for a, b in zip(known["lower"], known["upper"], strict=True)]
        across = size[0] if known["dimension"] == 2 else 0.9 * size[0] + 0.5 * size[1]
        tall = size[-1] if known["dimension"] == 2 else 0.95 * size[2] + 0.3 * size[1]
        aspect = min(max(across / max(tall, 1e-9), 1.0), 3.2)
        keys = "Arrow keys turn" if known["dimension"] == 3 else "Arrow keys move"
        help_ = f"Particles of {labels[index]}. Space plays, comma and full stop step, plus and minus zoom, 0 resets."
        caption = _shown(known, labels[index] if len(runs) > 1 else "")
        figures.append(
            f'<figure><canvas id="view-{index}" tabindex="0" role="img" aria-label="{escape(help_)} {keys}." '
            f'style="aspect-ratio:{aspect:.3f}"></canvas><figcaption>{escape(caption)}</figcaption></figure>'
        )
        channels |= set(known["groups"].get("fluid", {}).get("channels", {}))
    if not figures:
        return "<p class='note'>There are no frames that can be shown.</p>"
    several = " several" if len(figures) > 1 else ""
    three = any(made and made[0]["dimension"] == 3 for made in particles)
    notes.append(
        ("Drag turns, with shift it moves; " if three else "Drag moves; ")
        + "pinching zooms, and so does the wheel after a click; a click on a particle tells its values, to a "
        "250th of the scale; those beyond its ends have the colours of the ends. "
        "While it plays, positions are interpolated linearly between two frames; what stands still is a frame as "
        "it was written."
    )
    return (
        f'<div class="views{several}">{"".join(figures)}</div>{_controls(channels, runs)}'
        f'<p id="told" role="status"></p><p class="note">{escape(" ".join(notes))}</p>'
        + tables.records(runs, labels, seen)
    )


def _shown(known: dict[str, Any], label: str) -> str:
    """Return how many of the particles and frames are shown."""
    fluid, wall = (known["groups"].get(name, {"rows": 0, "all": 0}) for name in ("fluid", "wall"))
    shown, every = fluid["rows"] + wall["rows"], fluid["all"] + wall["all"]
    if shown == every:
        text = f"all {tables.number(every)} particles of fluid and wetted walls"
    else:
        text = (
            f"{tables.number(shown)} of {tables.number(every)} particles of fluid and wetted walls, evenly spread, "
            "each drawn larger; those with the extreme values of every frame are among them"
        )
    if len(known["frames"]) < known["all_frames"]:
        text += f"; {len(known['frames'])} of {known['all_frames']} frames"
    else:
        text += f"; all {known['all_frames']} frames" if known["all_frames"] > 1 else "; the only frame"
    return (f"{label}: " if label else "Shown: ") + text + "."


def _controls(channels: set[str], runs: Sequence[Results]) -> str:
    offered = [(n, t) for n, t in (("speed", "speed"), ("pressure", "pressure")) if n in channels]
    offered += [("material", "fluid")] if "material" in channels else []
    offered += [("free_surface", "free surface")] if "free_surface" in channels else []
    options = "".join(f'<option value="{name}">{text}</option>' for name, text in offered or [("none", "nothing")])
    rates = "".join(
        f'<option value="{rate}"{" selected" if rate == 1 else ""}>{text}</option>'
        for rate, text in ((0.125, "⅛ ×"), (0.25, "¼ ×"), (0.5, "½ ×"), (1, "1 ×"), (2, "2 ×"), (4, "4 ×"))
    )
    fluids = next((names for run in runs if (names := tables._names(run, "fluid"))), [])
    return f"""
<div class="controls">
<button id="play" type="button" aria-pressed="false">▶ Play</button>
<input id="scrub" type="range" min="0" max="0" value="0" step="1" aria-label="Frame">
<output id="clock" for="scrub"></output>
</div>
<div class="controls">
<label>colour <select id="colour">{options}</select></label>
<label>rate <select id="rate">{rates}</select></label>
<label><input id="walls" type="checkbox" checked> walls</label>
<label><input id="extreme" type="checkbox" checked> mark the largest</label>
<button id="closer" type="button" aria-label="Zoom in">+</button>
<button id="farther" type="button" aria-label="Zoom out">−</button>
<button id="reset" type="button">Reset view</button>
</div>
<div id="scale"><span id="quantity"></span><div class="ramp" style="background:{_ramp()}"></div>
<div class="ends"><span id="low"></span><span id="middle"></span><span id="high"></span></div></div>
<div id="legend" hidden><div data-of="material">{_dots(fluids)}</div>
<div data-of="free_surface">{_dots(["inside", "free surface"])}</div><div data-of="none"></div></div>"""


def _dots(names: Sequence[str]) -> str:
    return "".join(
        f'<span class="dot" style="background:{_CATEGORIES[min(index, len(_CATEGORIES) - 1)]}"></span>{escape(name)}'
        for index, name in enumerate(names)
    )


def _charts(wanted: Sequence[dict[str, Any]], everything: Sequence[dict[str, Any]]) -> str:
    figures = []
    for item in wanted:
        number = next(index for index, other in enumerate(everything) if other is item)
        lines = ", ".join(line["label"] for line in item["lines"])
        label = f"{item['title']}: {item['y']} over {item['x']}; {lines}"
        figures.append(
            f"<figure><h3>{escape(item['title'])}</h3>"
            f'<div class="chart" data-chart="{number}" role="img" aria-label="{escape(label)}"></div></figure>'
        )
    hint = "<p class='note'>A rectangle drawn with the mouse enlarges a part of a chart, a double click shows all.</p>"
    return f'<div class="charts">{"".join(figures)}</div>{hint}' if figures else ""


def _cases(runs: Sequence[Results], labels: Sequence[str]) -> str:
    parts = []
    for run, label in zip(runs, labels, strict=True):
        if run.case_text:
            summary = "The completed case, every key with its value" + (f": {label}" if len(runs) > 1 else "")
            parts.append(f"<details><summary>{escape(summary)}</summary><pre>{escape(run.case_text)}</pre></details>")
    return "".join(parts)


def _colours() -> Any:
    import matplotlib

    return matplotlib.colormaps["viridis"]


def _map() -> str:
    colours = (_colours()(np.linspace(0.0, 1.0, 256))[:, :3] * 255.0 + 0.5).astype(np.uint8)
    return base64.b64encode(colours.tobytes()).decode("ascii")


def _ramp() -> str:
    from matplotlib.colors import to_hex

    stops = ", ".join(to_hex(_colours()(share)) for share in np.linspace(0.0, 1.0, 17))
    return f"linear-gradient(to right, {stops})"


def _bytes(colours: Sequence[str]) -> str:
    return base64.b64encode(bytes.fromhex("".join(colour[1:] for colour in colours))).decode("ascii")
