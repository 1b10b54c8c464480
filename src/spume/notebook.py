"""How cases, simulations, frames and results show themselves in a notebook: a table, and a picture of the state."""

from __future__ import annotations

import base64
import io
from collections.abc import Iterable
from html import escape
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from spume.case import Case
    from spume.outputs.vtkhdf import Frame
    from spume.results import Results


def case_html(case: Case) -> str:
    """Return a case as an HTML table: what is simulated, how, and what is measured."""
    bodies = (f"{body.name} ({body.key}, {body.shape.key})" for body in case.body if hasattr(body, "shape"))
    models = ("gradient", "laplacian", "source", "free_surface", "solver")
    step = [f"{name.replace('_', ' ')} {getattr(case.step, name).key}" for name in models if hasattr(case.step, name)]
    rows = [
        ("spacing l0", f"{case.spacing:g} m, {case.dimension}D"),
        ("end", f"{case.time.end:g} s"),
        ("fluids", ", ".join(f"{f.name} ({f.shape.key}, {f.density:g} kg/m³)" for f in case.fluid)),
        ("bodies", ", ".join(bodies) or "none"),
        ("gauges", ", ".join(gauge.name for gauge in case.gauge) or "none"),
        ("step", f"{case.step.key}: {', '.join(step)}"),
    ]
    return table(f"Case: {case.title}" if case.title else "Case", rows)


def simulation_html(simulation: Any) -> str:
    """Return a `spume.Simulation` as HTML: where it is, and a picture of the present state."""
    snapshot = simulation.snapshot()
    rows = [
        ("time", f"{simulation.time:.6g} s of {simulation.clock.end:g} s, {simulation.step_index} steps"),
        ("time step", f"{simulation.dt:.3g} s"),
        ("particles", f"{len(snapshot):,}, {int(snapshot.fluid.sum()):,} of them fluid"),
        ("spacing l0", f"{snapshot.spacing:g} m, {snapshot.dimension}D"),
    ]
    return table("Simulation", rows) + image(simulation.plot(dpi=80))


def frame_html(frame: Frame) -> str:
    """Return a frame as HTML: its fields with units and ranges, and a picture."""
    rows = []
    for name in frame.fields:
        values = frame[name]
        span = f"{values.min():.4g} … {values.max():.4g}" if len(values) else ""
        unit = frame.units.get(name) or ""
        rows.append((name, f"{tuple(values.shape)}, {span} {unit}".rstrip()))
    return table(f"Frame {frame.index}: t = {frame.time:g} s", rows) + image(frame.plot(dpi=80))


def results_html(results: Results) -> str:
    """Return results as HTML: how the run ended, what it holds, and its last frame."""
    rows = [("folder", str(results.path)), ("status", results.status)]
    if len(results):
        rows.append(("frames", f"{len(results)}, t = {results.times[0]:g} … {results.times[-1]:g} s"))
        rows.append(("fields", ", ".join(results.fields)))
    rows.append(("gauges", ", ".join(results.gauge_names) or "none"))
    rows += [("problem", problem) for problem in results.problems]
    shown = image(results[-1].plot(dpi=80)) if len(results) else ""
    return table(f"Results: {results.title}", rows) + shown


def table(title: str, rows: Iterable[tuple[str, Any]]) -> str:
    """Return a table of two columns as HTML, its texts escaped."""
    lines = "".join(
        f'<tr><th style="text-align:left">{escape(name)}</th><td style="text-align:left">{escape(str(value))}</td></tr>'
        for name, value in rows
    )
    return f"<table><caption><b>{escape(title)}</b></caption>{lines}</table>"


def image(figure: Any) -> str:
    """Return a figure as an HTML image that holds its own data."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=figure.dpi)
    data = base64.b64encode(buffer.getvalue()).decode("ascii")
    return f'<img alt="particles" style="max-width:100%" src="data:image/png;base64,{data}">'
