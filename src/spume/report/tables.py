"""The page's tables."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume.outputs.reference import Comparison
from spume.progress import duration
from spume.report.particles import Overview
from spume.results import Results, RunFolderError
from spume.toml import flattened, literal


def number(value: Any, digits: int = 4) -> str:
    """Return a number as a reader wants it, ``–`` where there is none."""
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return "–"
    if isinstance(value, bool | str):
        return str(value)
    if isinstance(value, int | np.integer):
        return f"{int(value):,}".replace(",", " ")
    text = f"{value:.{digits}g}"
    return text.replace("e-0", "e-").replace("e+0", "e")


def typeset(unit: str) -> str:
    """Return a unit with raised exponents: ``m²`` for ``m^2``."""
    return unit.replace("^2", "²").replace("^3", "³")


def cell(value: Any, unit: str = "", digits: int = 4) -> str:
    """Return a table's cell; the whole value stands in its attribute ``data-value``."""
    shown = escape(number(value, digits)) + (f" {escape(unit)}" if unit and value is not None else "")
    exact = "" if value is None or isinstance(value, str) else f' data-value="{escape(repr(_plain(value)))}"'
    kind = ' class="number"' if exact else ""
    return f"<td{kind}{exact}>{shown}</td>"


def _plain(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def table(rows: Iterable[tuple[str, Sequence[str]]], head: Sequence[str] = (), caption: str = "") -> str:
    """Return a table of rows: a heading and cells; nothing where there are no rows."""
    body = "".join(f"<tr><th scope='row'>{escape(name)}</th>{''.join(cells)}</tr>" for name, cells in rows)
    if not body:
        return ""
    top = f"<caption>{escape(caption)}</caption>" if caption else ""
    if head:
        top += "<thead><tr>" + "".join(f"<th scope='col'>{escape(h)}</th>" for h in head) + "</tr></thead>"
    frame = f"<div class='wide' tabindex='0' role='region' aria-label='{escape(caption or 'table')}'>"
    return f"{frame}<table>{top}<tbody>{body}</tbody></table></div>"


def _by_run(runs: Sequence[Results], wanted: Iterable[tuple[str, Any, str]]) -> list[tuple[str, list[str]]]:
    """Return rows with one cell per run; a row that is empty for every run is left out."""
    rows = []
    for name, get, unit in wanted:
        values = [get(run) for run in runs]
        if any(v not in (None, "") for v in values):
            rows.append((name, [cell(v, unit) for v in values]))
    return rows


def _said(key: str) -> Any:
    return lambda run: run.summary.get(key)


def overview(runs: Sequence[Results], labels: Sequence[str]) -> str:
    """Return what was simulated."""
    wanted = [
        ("status", lambda run: run.status, ""),
        ("dimension", lambda run: run.dimension, ""),
        ("spacing of the particles", lambda run: run.spacing if np.isfinite(run.spacing) else None, "m"),
        ("particles", _said("particles_total"), ""),
        ("fluid particles", _said("particles_fluid"), ""),
        ("simulated time", _said("simulated_time"), "s"),
        ("steps", _said("steps"), ""),
        ("wall time", lambda run: _duration(run.summary.get("wall_time")), ""),
        ("fluids", _fluids, ""),
        ("bodies", lambda run: ", ".join(_names(run, "body")) or None, ""),
        ("gauges", lambda run: ", ".join(_names(run, "gauge")) or None, ""),
        ("step", lambda run: _selected(run.document.get("step")), ""),
        *((_words(key), _scheme(key), "") for key in _SCHEMES),
    ]
    return table(_by_run(runs, wanted), ["", *labels] if len(runs) > 1 else [])


_SCHEMES = (
    "source", "laplacian", "gradient", "divergence", "viscosity", "free_surface", "wall_model", "shifting", "collision",
    "solver",
)  # fmt: skip


def _scheme(key: str) -> Any:
    def get(run: Results) -> str | None:
        step = run.document.get("step")
        return _selected(step.get(key)) if isinstance(step, dict) else None

    return get


def _selected(value: Any) -> str | None:
    if isinstance(value, dict):
        value = value.get("name") or value.get("kind")
    return str(value) if isinstance(value, str) else None


def _words(key: str) -> str:
    return key.replace("_", " ")


def _names(run: Results, key: str) -> list[str]:
    items = run.document.get(key, [])
    return [str(i.get("name")) for i in items if isinstance(i, dict)] if isinstance(items, list) else []


def _fluids(run: Results) -> str | None:
    fluids = [f for f in run.document.get("fluid", []) if isinstance(f, dict)]
    texts = [f"{f.get('name')} ({number(f.get('density'))} kg/m³, {number(f.get('viscosity'))} m²/s)" for f in fluids]
    return ", ".join(texts) or None


def _duration(seconds: Any) -> str | None:
    if not isinstance(seconds, int | float):
        return None
    return duration(seconds) if seconds >= 10.0 else f"{seconds:.2g} s"


def comparisons(runs: Sequence[Results], labels: Sequence[str]) -> str:
    """Return how the gauges compare with their references."""
    several = len(runs) > 1
    head = [
        "gauge", *(["run"] if several else []), "unit", "peak", "measured", "band", "arrival", "measured", "rms error",
        "of range", "largest error", "compared",
    ]  # fmt: skip
    rows: list[tuple[str, list[str]]] = []
    found = [(index, c) for index, run in enumerate(runs) for c in run.comparisons]
    for name in dict.fromkeys(c.gauge for _, c in found):
        for index, c in found:
            if c.gauge == name:
                rows.append((name, ([f"<td>{escape(labels[index])}</td>"] if several else []) + _comparison(c)))
    notes = list(dict.fromkeys(f"measured: {c.source}" for _, c in found if c.source))
    shift = next((c for _, c in found if c.shift), None)
    if shift is not None and not several:
        notes.insert(0, f"errors after a common time shift of {shift.shift:+.3g} in {shift.time_label}")
    elif shift is not None:
        notes.insert(0, "errors after a common time shift of each run, given in the charts")
    text = table(rows, head, "Simulation against measurement")
    return text + ("<p class='note'>" + escape("; ".join(notes)) + "</p>" if text and notes else "")


def _comparison(c: Comparison) -> list[str]:
    unit = c.label.partition("[")[2].rstrip("] ") or c.label
    band = "–" if c.peak_band is None else f"{number(c.peak_band[0], 3)} … {number(c.peak_band[1], 3)}"
    share = c.rms / c.reference_range if c.rms is not None and c.reference_range else None
    inside = "" if c.peak_in_band is None else (" ✓ in band" if c.peak_in_band else " ✗ outside")
    peak = cell(c.peak, digits=3).replace("</td>", f"{inside}</td>")
    return [
        f"<td class='number'>{escape(unit)}</td>", peak, cell(c.reference_peak, digits=3),
        f"<td class='number'>{band}</td>", cell(c.arrival, digits=3), cell(c.reference_arrival, digits=3),
        cell(c.rms, digits=3), _percent(share), cell(c.max_error, digits=3), _percent(c.coverage),
    ]  # fmt: skip


def _percent(share: float | None) -> str:
    if share is None:
        return "<td class='number'>–</td>"
    return f'<td class="number" data-value="{share!r}">{100.0 * share:.3g} %</td>'


def budgets(runs: Sequence[Results], labels: Sequence[str], seen: Sequence[Overview | None]) -> str:
    """Return first, last, smallest and largest volume, energy and momentum, and their change."""
    rows = []
    for index, run in enumerate(runs):
        for name, values, unit, relative in _budgeted(run, seen[index]):
            values = values[np.isfinite(values)]
            if not len(values):
                continue
            title = (f"{labels[index]}: " if len(runs) > 1 else "") + f"{name} [{typeset(unit)}]"
            change = float(values[-1] - values[0])
            share = change / float(values[0]) if relative and values[0] > 0.0 else None
            cells = [cell(float(v)) for v in (values[0], values[-1], values.min(), values.max(), change)]
            rows.append((title, [*cells, _percent(share)]))
    head = ["", "first", "last", "smallest", "largest", "change", "relative"]
    return table(rows, head, "Volume and energy over the steps, momentum over the frames")


def _budgeted(run: Results, seen: Overview | None) -> Iterator[tuple[str, NDArray[np.float64], str, bool]]:
    """Yield name, values, unit of each budget, and whether its change relative to its first value says anything."""
    try:
        columns, units = run.columns()
    except RunFolderError:
        columns, units = {}, {}
    if "volume" in columns:
        yield "volume", columns["volume"], units["volume"], True
    if {"kinetic_energy", "potential_energy"} <= columns.keys():
        kinetic, potential, unit = columns["kinetic_energy"], columns["potential_energy"], units["kinetic_energy"]
        yield "kinetic energy", kinetic, unit, False
        yield "potential energy", potential, unit, True
        yield "total energy", kinetic + potential, unit, True
    for axis in "xyz"[: run.dimension]:
        if seen is not None and f"momentum_{axis}" in seen.series:
            yield f"momentum along {axis}", seen.series[f"momentum_{axis}"], momentum_unit(run), False


def momentum_unit(run: Results) -> str:
    """Return the unit of the momentum of a run's fluid."""
    return "kg m/s" if run.dimension == 3 else "kg m/s per m"


def solver(runs: Sequence[Results], labels: Sequence[str]) -> str:
    """Return iterations and the uses of limiters."""
    names = list(dict.fromkeys(name for run in runs for name in run.summary.get("counts") or {}))
    wanted = [
        ("pressure iterations, mean", _said("pressure_iterations_mean"), ""),
        ("pressure iterations, largest", _said("pressure_iterations_max"), ""),
        *((_words(n), lambda run, n=n: (run.summary.get("counts") or {}).get(n), "") for n in names),
    ]
    return table(_by_run(runs, wanted), ["", *labels] if len(runs) > 1 else [], "Iterations and uses of limiters")


def cost(runs: Sequence[Results], labels: Sequence[str]) -> str:
    """Return where the wall time of the steps went, with bars, and what a step costs."""
    parts = []
    for label, run in zip(labels, runs, strict=True):
        stages = {k: v for k, v in (run.summary.get("stage_times") or {}).items() if isinstance(v, int | float)}
        total = sum(stages.values())
        rows = []
        for name, seconds in sorted(stages.items(), key=lambda item: -item[1]):
            share = seconds / total if total > 0.0 else 0.0
            bar = f"<td class='bar'><span style='width:{100.0 * share:.1f}%'></span></td>"
            rows.append((_words(name), [cell(seconds, "s", 3), _percent(share), bar]))
        caption = "Wall time of the stages of a step, over the last process"
        parts.append(table(rows, ["stage", "time", "share", ""], f"{label}: {caption}" if len(runs) > 1 else caption))
    wanted = [
        ("wall time", _said("wall_time"), "s"),
        ("steps alone", _said("wall_time_steps"), "s"),
        ("compilation of kernels", _said("wall_time_compilation"), "s"),
        ("outputs", _said("wall_time_outputs"), "s"),
        ("per fluid particle and step", _said("us_per_fluid_particle_step"), "µs"),
        ("processes", _said("sessions"), ""),
    ]
    head = ["", *labels] if len(runs) > 1 else []
    return "".join(parts) + table(_by_run(runs, wanted), head, "Times of the whole run")


def records(runs: Sequence[Results], labels: Sequence[str], seen: Sequence[Overview | None]) -> str:
    """Return the extremes over all fluid rows of all frames."""
    rows = []
    units = {"pressure": "Pa", "speed": "m/s"}
    for index, overview_ in enumerate(seen):
        for name, found in () if overview_ is None else overview_.records.items():
            if name == "smallest speed":
                continue
            place = ", ".join(number(x) for x in found["place"])
            title = (f"{labels[index]}: " if len(runs) > 1 else "") + name
            cells = [cell(found["value"], units[name.split()[1]]), cell(found["time"], "s"), f"<td>({place}) m</td>"]
            rows.append((title, cells))
    return table(rows, ["", "value", "time", "place"], "Extremes of all fluid particles, in the frames")


def environment(runs: Sequence[Results], labels: Sequence[str]) -> str:
    """Return what the runs were computed on and with."""

    def of(key: str) -> Any:
        return lambda run: (run.summary.get("environment") or {}).get(key)

    def versions(run: Results) -> dict[str, Any]:
        return of("libraries")(run) or {}

    libraries = dict.fromkeys(name for run in runs for name in versions(run))
    wanted = [
        ("Spume", _said("version"), ""),
        ("device", _said("device"), ""),
        ("threads", _said("threads"), ""),
        ("precision", _said("precision"), ""),
        ("largest memory", lambda run: _mebibytes(run.summary.get("peak_memory_bytes")), "MiB"),
        ("started", of("started"), ""),
        ("system", of("system"), ""),
        ("processor", of("processor"), ""),
        ("cores", of("cores"), ""),
        ("Python", of("python"), ""),
        *((name, lambda run, n=name: versions(run).get(n), "") for name in libraries),
    ]
    return table(_by_run(runs, wanted), ["", *labels] if len(runs) > 1 else [])


def _mebibytes(size: Any) -> float | None:
    return size / 2**20 if isinstance(size, int | float) else None


def differences(runs: Sequence[Results], labels: Sequence[str]) -> str:
    """Return the keys of the completed cases that are not the same in all runs."""
    flat: list[Mapping[str, Any]] = [dict(flattened(run.document)) for run in runs]
    rows = []
    for key in dict.fromkeys(key for keys in flat for key in keys):
        values = [keys.get(key) for keys in flat]
        if any(v != values[0] for v in values[1:]):
            rows.append((key, [f"<td>{'–' if v is None else escape(literal(v))}</td>" for v in values]))
    return table(rows, ["key", *labels], "Where the cases differ")
