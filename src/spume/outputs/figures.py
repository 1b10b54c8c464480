"""Figures of a run that is there: snapshots at chosen times, gauges over time, space–time diagrams."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
from numpy.typing import NDArray

from spume.named import nearest_match
from spume.outputs import pictures, record, section
from spume.outputs.output import MapName, OutputSettings
from spume.outputs.plots import plot_gauge
from spume.outputs.reference import common_shift, simulated
from spume.problems import CaseError, Problem

if TYPE_CHECKING:
    from spume.results import Results

FOLDER = "plots"
"""Where the figures go, in the run folder."""

FORMATS = ("png", "pdf", "svg")

_FRAMES = 200  # of a space–time diagram
_SHOWN = (0.25, 0.5, 0.75, 1.0)  # of the simulated time


class PlotError(CaseError):
    """A figure that cannot be drawn; the message says which argument is wrong and what is allowed."""

    def __init__(self, key: str, value: str, message: str) -> None:
        super().__init__([Problem("", key, value, message)])


def plot_run(
    results: Results,
    out: Path | None = None,
    *,
    times: Sequence[float] = (),
    gauges: Sequence[str] = (),
    line: tuple[Sequence[float], Sequence[float]] | None = None,
    settings: OutputSettings | None = None,
    file_format: str = "png",
) -> list[Path]:
    """Draw figures of a run; return the files.

    Without times, gauges and line everything is drawn: four snapshots, every gauge with what it is compared with,
    and the space–time diagrams that gauges in a line and the frames give. Otherwise what is named is.

    Args:
        results: the run.
        out: folder of the figures; default: ``plots`` in the run folder. Figures that exist are replaced.
        times: instants of the snapshots [s]; the frames nearest to them are drawn.
        gauges: names of gauges.
        line: ends of a line [m], along which the pressure and, unless it is vertical, the elevation are drawn over
            time, from the frames.
        settings: colours and camera; default: those of the case.
        file_format: ``png``, ``pdf`` or ``svg``.

    Raises:
        PlotError: an unknown gauge, field or format, or a line that does not fit the run.
        RunFolderError: frames are asked for and there are none.
    """
    import matplotlib

    if file_format not in FORMATS:
        raise PlotError("format", repr(file_format), f"one of {', '.join(FORMATS)}")
    for name in gauges:
        if name not in results.gauge_names:
            known = ", ".join(results.gauge_names) or "(the run has none)"
            raise PlotError("gauge", repr(name), f"one of {known}{nearest_match(name, results.gauge_names)}")
    everything = not (times or gauges or line)
    folder = results.path / FOLDER if out is None else Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    drawn: list[Path] = []
    if times or (everything and len(results)):
        drawn.append(snapshots(results, times, folder / f"snapshots.{file_format}", settings))
    with matplotlib.rc_context(pictures.STYLE):
        if gauges or everything:
            drawn += _gauges(results, gauges or results.gauge_names, folder, file_format)
        found = _diagrams_of_line(results, line) if line else _diagrams(results) if everything else []
        for name, diagram in found:
            drawn.append(draw_diagram(diagram, folder / f"{name}.{file_format}"))
    return drawn


def settings_of(results: Results, **changes: Any) -> OutputSettings:
    """Return the settings of a run's pictures: those of its case, with changes that are not None.

    Raises:
        PlotError: a colour map or a value that is not allowed.
    """
    from pydantic import ValidationError

    given = results.document.get("output")
    known = OutputSettings.model_fields
    kept = {key: value for key, value in given.items() if key in known} if isinstance(given, dict) else {}
    changes = {key: value for key, value in changes.items() if value is not None}
    if "map" in changes and changes["map"] not in get_args(MapName):
        near = nearest_match(str(changes["map"]), get_args(MapName))
        raise PlotError("map", repr(changes["map"]), f"one of {', '.join(get_args(MapName))}{near}")
    if "colour" in changes and changes["colour"] != kept.get("colour"):
        kept = {key: value for key, value in kept.items() if key not in ("map", "colour_range")}
    try:
        return OutputSettings.model_validate({**kept, **changes})
    except ValidationError as error:
        first = error.errors()[0]
        raise PlotError(str(first["loc"][0]), repr(first["input"]), first["msg"]) from None


def fluids_of(results: Results) -> list[str]:
    """Return the names of a run's fluids, in the order of the field ``material``."""
    tables = results.document.get("fluid")
    return [str(table.get("name")) for table in tables if isinstance(table, dict)] if isinstance(tables, list) else []


def check_colour(results: Results, colour: str) -> None:
    """Raise PlotError where the frames do not have the field that is to colour them."""
    if not len(results):
        return
    frame = results[0]
    scalars = ["speed"] if "velocity" in results.fields else []
    scalars += [name for name in results.fields if frame[name].ndim == 1]
    if colour not in scalars:
        raise PlotError("colour", repr(colour), f"one of {', '.join(scalars)}{nearest_match(colour, scalars)}")


def snapshots(results: Results, times: Sequence[float], path: Path, settings: OutputSettings | None = None) -> Path:
    """Draw the frames nearest to some instants [s] in one figure; without instants four of the whole run."""
    settings = settings or settings_of(results)
    check_colour(results, settings.colour)
    if times:
        chosen = {frame.index: frame for frame in (results.at(t) for t in times)}
    else:
        numbers = sorted({round((len(results) - 1) * share) for share in _SHOWN})
        chosen = {number: results[number] for number in numbers}
    frames = [chosen[k] for k in sorted(chosen)]
    return pictures.draw_frames(frames, path, settings, results.title, 150, fluids_of(results))


def _gauges(results: Results, names: Sequence[str], folder: Path, file_format: str) -> list[Path]:
    references = results.references
    shift = common_shift([(r, r.load(), simulated(r, results.path)) for r in references]) if references else 0.0
    drawn = []
    for name in names:
        mine = [r for r in references if r.gauge == name]
        columns, _ = results.columns(name)
        if len(columns) < 2 or len(columns["time"]) == 0:
            continue
        file = record.path(results.path, name)
        drawn.append(plot_gauge(folder / f"gauge-{name}.{file_format}", file, pictures.new_figure, mine, shift))
    return drawn


# --------------------------------------------------------------------------------- space–time diagrams


def _diagrams(results: Results) -> list[tuple[str, section.Diagram]]:
    """Return the diagrams that a run gives unasked, with the names of their files."""
    found = []
    tables = [g for g in results.document.get("gauge", []) if g.get("name") in results.gauge_names]
    for kind in ("pressure", "elevation"):
        line = section.gauges_in_line(tables, kind)
        series = {}
        for name, _ in line:
            columns, units = results.columns(name)
            column = next(n for n in columns if n != "time")
            series[name] = (columns["time"], columns[column])
        if line and all(len(time) > 1 for time, _ in series.values()):
            diagram = section.between_gauges(line, series, kind, units[column], results.dimension)
            found.append((f"space-time-{kind}-gauges", diagram))
    if len(results) > 1 and {"kind", "to_surface"} <= set(results.fields):
        first, last = _across(results)
        diagram = section.elevation_along(_some(results), first, last, results.spacing)
        if np.isfinite(diagram.values).any():
            found.append(("space-time-elevation", diagram))
    return found


def _diagrams_of_line(
    results: Results, line: tuple[Sequence[float], Sequence[float]]
) -> list[tuple[str, section.Diagram]]:
    first, last = (np.asarray(end, dtype=float) for end in line)
    d = results.dimension
    shown = " : ".join(", ".join(f"{v:g}" for v in end) for end in line)
    if len(first) != d or len(last) != d or np.allclose(first, last):
        raise PlotError("line", shown, f"two different points of {d} numbers each, for the run is {d}D")
    lacking = {"kind", "to_surface", "pressure"} - set(results.fields)
    if len(results) < 2 or lacking:
        why = f"lack {', '.join(sorted(lacking))} (output.fields)" if len(results) > 1 else "are fewer than two"
        raise PlotError("line", shown, f"the frames of {results.path} {why}")
    found = [("space-time-pressure-line", section.pressure_along(_some(results), first, last, results.spacing))]
    if not np.allclose(first[:-1], last[:-1]):
        diagram = section.elevation_along(_some(results), first[:-1], last[:-1], results.spacing)
        found.append(("space-time-elevation-line", diagram))
    return found


def _some(results: Results) -> list[Any]:
    stride = max(-(-len(results) // _FRAMES), 1)
    return [results[number] for number in range(0, len(results), stride)]


def _across(results: Results) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the ends of a line along x through the middle of what the frames show [m], shape (d − 1,)."""
    lower, upper = [], []
    for number in {0, len(results) // 2, len(results) - 1}:
        frame = results[number]
        wall = frame["kind"] == section.WALL
        inside = np.asarray(frame["position"], dtype=float) + np.where(wall[:, None], frame["to_surface"], 0.0)
        rows = inside[wall] if wall.any() else inside[frame["kind"] == section.FLUID]
        lower.append(rows.min(axis=0)[:-1])
        upper.append(rows.max(axis=0)[:-1])
    low, high = np.min(lower, axis=0), np.max(upper, axis=0)
    middle = 0.5 * (low + high)
    first, last = middle.copy(), middle.copy()
    first[0], last[0] = low[0] + 1e-6 * results.spacing, high[0] - 1e-6 * results.spacing
    return first, last


def draw_diagram(diagram: section.Diagram, path: Path, dpi: int = 150) -> Path:
    """Draw a quantity along a line over time; return the file.

    Args:
        diagram: the quantity.
        path: the picture.
        dpi: pixels per inch.
    """
    finite = diagram.values[np.isfinite(diagram.values)]
    low, high = (float(np.quantile(finite, q)) for q in (0.005, 0.995)) if len(finite) else (0.0, 1.0)
    if low >= -0.05 * high and high > 0.0:
        low = 0.0
    scale, prefix = (1e3, "k") if diagram.unit == "Pa" and high >= 1e4 else (1.0, "")
    high = high if high > low else low + (abs(low) or 1.0)
    along = f"{diagram.axis} [m]"
    width, height = (7.6, 4.0) if diagram.vertical else (6.6, 5.2)
    made = pictures.new_figure(width, height, dpi)
    axes = made.add_axes((0.62 / width, 0.5 / height, (width - 1.75) / width, (height - 0.95) / height))
    values = diagram.values / scale
    edges = _edges(diagram.place), _edges(diagram.time)
    if diagram.vertical:
        mesh = axes.pcolormesh(edges[1], edges[0], values.T, rasterized=True)
        labels = "t [s]", along
    else:
        mesh = axes.pcolormesh(edges[0], edges[1], values, rasterized=True)
        labels = along, "t [s]"
    mesh.set_cmap("cividis" if diagram.quantity == "elevation" else "viridis")
    mesh.set_clim(low / scale, high / scale)
    for mark in diagram.marks:
        line = axes.axhline if diagram.vertical else axes.axvline
        line(mark, color="white", linewidth=0.8, linestyle=(0, (2, 3)), alpha=0.9)
        at, marker = ((0.0, mark), ">") if diagram.vertical else ((mark, 0.0), "^")
        where = axes.get_yaxis_transform() if diagram.vertical else axes.get_xaxis_transform()
        axes.plot(*at, marker=marker, color="#D55E00", markersize=6, transform=where, clip_on=False, zorder=5)
    axes.set_xlabel(labels[0])
    axes.set_ylabel(labels[1])
    axes.set_facecolor("#DDDDDD")
    axes.tick_params(length=3, width=0.8)
    title = diagram.quantity.capitalize() + (" at the gauges" if len(diagram.marks) else "")
    axes.set_title(title, loc="left", weight="bold", pad=8)
    axes.set_title(diagram.note, loc="right", pad=8, fontsize=8.5, color="#555555")
    scale_axes = made.add_axes(((width - 0.98) / width, 0.5 / height, 0.14 / width, (height - 0.95) / height))
    beyond = "max" if len(finite) and float(finite.max()) / scale > 1.02 * high / scale else "neither"
    bar = made.colorbar(mesh, cax=scale_axes, extend=beyond, extendfrac=0.03)
    bar.set_label(f"{diagram.quantity} [{prefix}{diagram.unit}]", labelpad=5)
    bar.outline.set_linewidth(0.5)
    scale_axes.tick_params(length=3, width=0.6, labelsize=8.5)
    made.savefig(path)
    return path


def _edges(centre: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the borders of cells around points that need not be evenly spaced, shape (points + 1,)."""
    if len(centre) == 1:
        return np.array([centre[0] - 0.5, centre[0] + 0.5])
    middle = 0.5 * (centre[1:] + centre[:-1])
    edges: NDArray[np.float64] = np.concatenate([[centre[0]], middle, [centre[-1]]])
    return edges
