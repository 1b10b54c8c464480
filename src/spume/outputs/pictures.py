"""Pictures of a run: ``snapshot.png``, an animation, and a plot of every gauge.

Everything is drawn from the files of the run folder, so it can be drawn again later.
"""

from __future__ import annotations

import functools
import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume.outputs import frames, raster, scene, vtkhdf
from spume.outputs.film import ffmpeg, write_gif, write_mp4
from spume.outputs.output import Output, OutputSettings, RunLike
from spume.outputs.plots import plot_gauges
from spume.outputs.record import FOLDER as GAUGE_FOLDER
from spume.outputs.reference import Reference
from spume.outputs.snapshot import FLUID, WALL, Snapshot

_ANIMATION_FRAMES = 100
_WALL_COLOUR = np.array([0.55, 0.57, 0.60], dtype=np.float32)
_DUMMY_COLOUR = np.array([0.76, 0.77, 0.79], dtype=np.float32)
_DRAWN = ("position", "kind", "body", "velocity", "pressure", "free_surface", "to_surface")
_TITLES = {"speed": ("speed", "m/s"), "number_density": ("number density", "1"), "material": ("fluid", "")}


# From deep to bright water; lightness grows evenly, so it reads in grey and for the colour-blind.
_WATER = ("#0a2f5c", "#125a94", "#2087b8", "#4db3c6", "#96d6c3", "#e2eeb0")

FLUID_COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#d55e00", "#56b4e9")
"""Okabe & Ito's colours, as in the report."""


def map_of(settings: OutputSettings) -> Any:
    """Return matplotlib's colour map: the chosen one, or the default for the field."""
    import matplotlib
    from matplotlib.colors import LinearSegmentedColormap

    name = settings.map or ("water" if settings.colour == "speed" else "viridis")
    if name == "water":
        return LinearSegmentedColormap.from_list("water", _WATER)
    return matplotlib.colormaps[name]


def values_of(frame: vtkhdf.Frame, colour: str) -> NDArray[np.float64]:
    """Return the values that colour the rows, shape (rows,).

    Raises:
        KeyError: a field that the frames do not have, or that is no scalar.
    """
    if colour == "speed":
        return np.linalg.norm(np.asarray(frame["velocity"], dtype=float), axis=1)
    if colour not in frame or frame[colour].ndim != 1:
        scalars = sorted(k for k, v in frame.arrays.items() if v.ndim == 1)
        raise KeyError(f"output: colour = {colour!r}: speed or one of {', '.join(scalars)}")
    return np.asarray(frame[colour], dtype=float)


def frame_of(snapshot: Snapshot, colour: str | None = None) -> vtkhdf.Frame:
    """Return a snapshot as a frame, so that it can be drawn, with the field that is to colour it.

    Raises:
        KeyError: no such field.
    """
    fields = dict.fromkeys((*_DRAWN, colour)) if colour else _DRAWN
    if colour and colour not in snapshot:
        raise KeyError(f"colour = {colour!r}: speed or one of {', '.join(sorted(snapshot.fields))}")
    return vtkhdf.Frame(
        time=snapshot.time,
        index=0,
        arrays={name: snapshot[name] for name in fields},
        spacing=snapshot.spacing,
        dimension=snapshot.dimension,
        units={name: snapshot.unit(name) for name in fields},
    )


@dataclass(frozen=True)
class View:
    """What all pictures of a run share: the part of space they show and the scale of colours.

    Attributes:
        lower, upper: corners of what is shown [m], shape (d,).
        low, high: values at the ends of the colour scale [SI unit of the field].
        settings: the case's settings of pictures.
        classes: names of the values 0, 1 … of a field that counts, which has a colour for each.
    """

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    low: float
    high: float
    settings: OutputSettings
    classes: tuple[str, ...] = ()

    @property
    def map(self) -> Any:
        """Matplotlib's colour map, from `low` to `high`."""
        from matplotlib.colors import ListedColormap

        whole = map_of(self.settings)
        if not self.classes:
            return whole
        if self.settings.map is None and len(self.classes) <= len(FLUID_COLOURS):
            return ListedColormap(FLUID_COLOURS[: len(self.classes)])
        return ListedColormap(whole(np.linspace(0.0, 1.0, len(self.classes))))

    @property
    def size(self) -> NDArray[np.float64]:
        """Extent of what is shown [m], shape (d,)."""
        return self.upper - self.lower


def view_of(sample: Sequence[vtkhdf.Frame], settings: OutputSettings, fluids: Sequence[str] = ()) -> View:
    """Choose window and colour scale from some frames of a run, which has these fluids."""
    corners = []
    values = []
    for frame in sample:
        position = np.asarray(frame["position"], dtype=float)
        fluid = frame["kind"] == FLUID
        solid = ~fluid
        if frame.dimension == 3 and "to_surface" in frame and np.any(wall := frame["kind"] == WALL):
            position, solid = position + np.asarray(frame["to_surface"], dtype=float), wall  # no thickness is shown
        if np.any(solid):
            corners.append([position[solid].min(axis=0), position[solid].max(axis=0)])
        if np.any(fluid):
            # All but the few drops that fly highest.
            corners.append([np.quantile(position[fluid], q, axis=0) for q in (0.0005, 0.9995)])
            values.append(values_of(frame, settings.colour)[fluid])
    everything = np.array(corners)
    margin = 0.5 * sample[0].spacing
    lower, upper = everything[:, 0].min(axis=0) - margin, everything[:, 1].max(axis=0) + margin
    if settings.colour == "material" and settings.colour_range is None:
        count = 1 + int(max((v.max() for v in values), default=0.0))
        names = tuple(fluids) if len(fluids) >= count else tuple(str(number) for number in range(count))
        return View(lower, upper, -0.5, len(names) - 0.5, settings, names)
    if settings.colour_range is not None:
        low, high = settings.colour_range
    else:
        merged = np.concatenate(values) if values else np.zeros(1)
        low, high = (float(np.quantile(merged, q)) for q in (0.01, 0.99))
        if settings.colour == "speed":
            # Every frame counts the same, so a short violent moment may go beyond the scale.
            low, high = 0.0, _nice(max(high, 1e-9))
        elif low >= -0.05 * high and high > 0.0:
            low, high = 0.0, _nice(high)
    if not high > low:
        high = low + (abs(low) or 1.0)
    return View(lower, upper, low, high, settings)


def _nice(value: float) -> float:
    """Return the smallest of 1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10 times a power of ten that is not below."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * next(m for m in (1, 1.5, 2, 2.5, 3, 4, 5, 6, 8, 10) if m * power >= value * (1 - 1e-9)))


Painter = Callable[[vtkhdf.Frame, View, tuple[int, int], bool], raster.Image]
"""What paints a frame: as `paint`, with the same arguments."""


def paint(frame: vtkhdf.Frame, view: View, shape: tuple[int, int], fine: bool = True) -> raster.Image:
    """Return the picture of a frame, RGB, of this height and width [pixels].

    Three-dimensional pictures that are not ``fine`` are drawn without smoothing of edges, in a quarter
    of the time.
    """
    fluid = frame["kind"] == FLUID
    share = np.zeros(len(fluid))
    share[fluid] = (values_of(frame, view.settings.colour)[fluid] - view.low) / (view.high - view.low)
    table = view.map(np.linspace(0.0, 1.0, 256))[:, :3].astype(np.float32)
    colours = table[np.clip(np.nan_to_num(share) * 255.0 + 0.5, 0, 255).astype(int)]
    wall = frame["kind"] == WALL
    colours[~fluid] = _DUMMY_COLOUR
    colours[wall] = _WALL_COLOUR
    big = (2 * shape[0], 2 * shape[1])
    if frame.dimension == 3 and not fine:
        return scene.paint(frame, view, shape, colours)
    if frame.dimension == 3:
        return raster.halve(scene.paint(frame, view, big, colours))
    position = np.asarray(frame["position"], dtype=float)
    l0 = frame.spacing
    window = raster.Window(view.lower, view.upper, float(np.min(np.array(big[::-1]) / view.size)))
    solid = ~fluid
    ground, _ = raster.paint_cells(window, position[solid], 0.505 * l0, square=True)
    # Inside the fluid discs overlap into an area without gaps; at the surface they keep their size.
    inner = frame["free_surface"][fluid] == 0 if "free_surface" in frame else np.ones(int(fluid.sum()), bool)
    water, distance = raster.paint_cells(window, position[fluid], np.where(inner, 0.9, 0.6) * l0)
    image = raster.compose((ground, colours[solid]), (water, colours[fluid]))
    if l0 * window.scale > 7.0:  # particles large enough to be told apart
        shade = np.where(water >= 0, 1.0 - 0.22 * np.minimum(distance / (0.6 * l0), 1.0) ** 2, 1.0)
        image = (image * shade[:, :, None] + 0.5).astype(np.uint8)
    return raster.halve(image)


# ------------------------------------------------------------------------------------------- figures


def new_figure(width: float, height: float, dpi: int) -> Any:
    """Return a new figure that draws without a screen and leaves the user's choice of one alone."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    made = _figure_class()(figsize=(width, height), dpi=dpi, facecolor="white")
    FigureCanvasAgg(made)
    return made


@functools.cache
def _figure_class() -> Any:
    """Return a figure that a notebook shows, also where matplotlib's backend for notebooks was not loaded."""
    from matplotlib.figure import Figure

    class Picture(Figure):
        def _repr_png_(self) -> bytes:
            buffer = io.BytesIO()
            self.savefig(buffer, format="png", dpi=self.dpi)
            return buffer.getvalue()

    return Picture


STYLE = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": 9.5,
    "axes.titlesize": 10,
    "axes.linewidth": 0.8,
    "axes.edgecolor": "#444444",
    "axes.labelcolor": "#222222",
    "xtick.color": "#444444",
    "ytick.color": "#444444",
    "text.color": "#222222",
    "svg.fonttype": "none",
}


class _Panels:
    """A figure with panels of one size, pixel for pixel, and one colour scale below or beside them."""

    def __init__(
        self,
        view: View,
        dimension: int,
        rows: int,
        columns: int,
        width: float,
        dpi: int,
        title: str,
        fine: bool = True,
        painter: Painter | None = None,
    ) -> None:
        self.view, self.dimension, self.fine = view, dimension, fine
        self.painter: Painter = painter or paint
        inch = _Inches(dimension)
        panel = (width - inch.right - columns * inch.left - (columns - 1) * inch.gap) / columns
        if dimension == 2:
            aspect = view.size[1] / view.size[0]
        else:
            azimuth, height = view.settings.view_deg
            low, high = raster.Camera(view.lower, view.upper, azimuth, height, (1, 1)).extent()
            aspect = float((high - low)[1] / (high - low)[0])
        if panel * aspect > 6.0 / rows:  # tall domains: let the height decide, not the width
            panel = 6.0 / rows / aspect
            width = columns * (panel + inch.left) + (columns - 1) * inch.gap + inch.right
        tall = panel * aspect
        head = inch.head if title else 0.12
        height_all = (
            head + rows * (tall + inch.title) + (rows - 1) * inch.gap + inch.bottom * (rows if dimension == 2 else 1)
        )
        self.figure = new_figure(width, height_all, dpi)
        self.shape = (max(round(tall * dpi), 2), max(round(panel * dpi), 2))
        size = (self.shape[1] / dpi / width, self.shape[0] / dpi / height_all)
        self.axes = []
        y = height_all - head
        for _ in range(rows):
            y -= inch.title + tall
            for column in range(columns):
                x = inch.left + column * (panel + inch.left + inch.gap)
                # On whole pixels: the image is shown as it was painted, not resampled.
                corner = (round(x * dpi) / dpi / width, round(y * dpi) / dpi / height_all)
                self.axes.append(self.figure.add_axes((*corner, *size)))
            y -= inch.gap + (inch.bottom if dimension == 2 else 0.0)
        if title:
            self.figure.text(inch.left / width, 1.0 - 0.24 / height_all, title, fontsize=12, weight="bold", va="center")
        self._scale(width, height_all, inch, head)
        self.images: list[Any] = []
        self.times: list[Any] = []
        for axes in self.axes:
            self._prepare(axes)

    def _prepare(self, axes: Any) -> None:
        view = self.view
        blank = np.full((*self.shape, 3), 255, dtype=np.uint8)
        if self.dimension == 2:
            extent = (view.lower[0], view.upper[0], view.lower[1], view.upper[1])
            self.images.append(axes.imshow(blank, extent=extent, interpolation="nearest", aspect="auto"))
            axes.set_xlabel("x [m]", labelpad=2)
            axes.set_ylabel("y [m]", labelpad=3)
            axes.tick_params(length=3, width=0.8, labelsize=8.5, direction="out")
            axes.locator_params(nbins=6)
            for side in axes.spines.values():
                side.set_visible(False)
        else:
            self.images.append(axes.imshow(blank, interpolation="nearest", aspect="auto"))
            axes.set_axis_off()
        self.times.append(axes.set_title("", loc="left", pad=4, fontsize=9.5))

    def _scale(self, width: float, height: float, inch: _Inches, head: float) -> None:
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize

        view = self.view
        top = max(a.get_position().y1 for a in self.axes)
        bottom = min(a.get_position().y0 for a in self.axes)
        long = min(top - bottom, 2.6 / height)
        axes = self.figure.add_axes(
            ((width - inch.right + 0.16) / width, 0.5 * (top + bottom - long), 0.13 / width, long)
        )
        mappable = ScalarMappable(Normalize(view.low, view.high), view.map)
        bar = self.figure.colorbar(mappable, cax=axes)
        name, unit = _TITLES.get(view.settings.colour, (view.settings.colour.replace("_", " "), ""))
        unit = unit or {"pressure": "Pa"}.get(view.settings.colour, "")
        bar.set_label(f"{name} [{unit}]" if unit else name, labelpad=5)
        bar.outline.set_linewidth(0.5)
        axes.tick_params(length=3, width=0.6, labelsize=8.5)
        if not view.classes:
            axes.locator_params(nbins=6)
            return
        bar.set_ticks(range(len(view.classes)), labels=view.classes)
        axes.tick_params(length=0)
        if max(map(len, view.classes)) > 6:  # there is no room beside the scale
            for text in axes.get_yticklabels():
                text.set(rotation=90, verticalalignment="center")

    def show(self, panel: int, frame: vtkhdf.Frame, end: float) -> None:
        """Draw a frame of a run that ends at ``end`` [s] into a panel."""
        self.images[panel].set_data(self.painter(frame, self.view, self.shape, self.fine))
        decimals = max(2 - int(np.floor(np.log10(end))), 0) if end > 0.0 else 2
        self.times[panel].set_text(f"t = {frame.time:.{decimals}f} s")


class _Inches:
    """Margins of a figure [inches]."""

    def __init__(self, dimension: int) -> None:
        self.left = 0.56 if dimension == 2 else 0.1
        self.right = 0.92
        self.bottom = 0.42 if dimension == 2 else 0.1
        self.gap = 0.10
        self.title = 0.22
        self.head = 0.38


def draw_frames(
    chosen: Sequence[vtkhdf.Frame],
    path: Path,
    settings: OutputSettings | None = None,
    title: str = "",
    dpi: int = 150,
    fluids: Sequence[str] = (),
) -> Path:
    """Draw some frames, each in a panel, with one colour scale; return the file.

    Args:
        chosen: the frames, at least one.
        path: the picture, ``*.png``, ``*.pdf`` or ``*.svg``.
        settings: colours and camera.
        title: text above.
        dpi: pixels per inch.
        fluids: names of the fluids.
    """
    frames_figure(chosen, settings, title, dpi, fluids=fluids).savefig(path, dpi=dpi)
    return path


def frames_figure(
    chosen: Sequence[vtkhdf.Frame],
    settings: OutputSettings | None = None,
    title: str = "",
    dpi: int = 150,
    painter: Painter | None = None,
    fluids: Sequence[str] = (),
) -> Any:
    """Return matplotlib's figure of some frames, each in a panel, with one colour scale.

    Args:
        chosen: the frames, at least one.
        settings: colours and camera.
        title: text above.
        dpi: pixels per inch.
        painter: what paints a panel; default: `paint`.
        fluids: names of the fluids.

    Raises:
        KeyError: the frames do not have the field that is to colour them.
    """
    import matplotlib

    settings = settings or OutputSettings()
    view = view_of(chosen, settings, fluids)
    with matplotlib.rc_context(STYLE):
        columns = 1 if len(chosen) == 1 else 2
        if len(chosen) > 1 and chosen[0].dimension == 2 and view.size[1] > 1.4 * view.size[0]:
            columns = len(chosen)
        panels = _Panels(
            view,
            chosen[0].dimension,
            -(-len(chosen) // columns),
            columns,
            8.0 if columns == 1 else 10.5,
            dpi,
            title,
            painter=painter,
        )
        for axes in panels.axes[len(chosen) :]:
            axes.set_axis_off()
        for number, frame in enumerate(chosen):
            panels.show(number, frame, max(f.time for f in chosen))
    return panels.figure


def plot(frame: vtkhdf.Frame, colour: str | None, dpi: int, settings: Mapping[str, Any], title: str = "") -> Any:
    """Return matplotlib's figure of one frame.

    Args:
        frame: the frame.
        colour: field that colours it; default: ``speed``.
        dpi: pixels per inch.
        settings: further keys of a case's ``[output]`` table.
        title: text above.

    Raises:
        KeyError: no such field.
        CaseError: a setting that is not allowed.
    """
    return frames_figure([frame], OutputSettings(**{"colour": colour or "speed", **settings}), title, dpi)


def animate(
    reader: vtkhdf.Reader,
    path: Path,
    settings: OutputSettings | None = None,
    title: str = "",
    dpi: int = 96,
    painter: Painter | None = None,
    told: Callable[[int, int], None] | None = None,
    fluids: Sequence[str] = (),
) -> Path:
    """Animate the frames of a run; return the file, whose ending says the format (``.gif``, ``.mp4``).

    At most 100 frames are drawn. Where ffmpeg cannot write an mp4 a gif is made instead.

    Args:
        reader: the frames.
        path: the film.
        settings: colours and camera.
        title: text above.
        dpi: pixels per inch.
        painter: what paints a frame; default: `paint`.
        told: is told how many pictures are drawn, and of how many.
        fluids: names of the fluids.
    """
    import matplotlib

    settings = settings or OutputSettings()
    stride = max(-(-len(reader) // _ANIMATION_FRAMES), 1)
    numbers = list(range(0, len(reader), stride))
    fields = fields_of(reader, settings)
    sample = [reader.read(n, fields) for n in numbers[:: max(len(numbers) // 12, 1)]]
    view = view_of(sample, settings, fluids)
    with matplotlib.rc_context(STYLE):
        panels = _Panels(view, reader.dimension, 1, 1, 8.0, dpi, title, False, painter)

        def images() -> Iterator[NDArray[np.uint8]]:
            canvas, axes = panels.figure.canvas, panels.axes[0]
            moving = (panels.images[0], panels.times[0])
            for artist in moving:
                artist.set_animated(True)
            canvas.draw()
            still = canvas.copy_from_bbox(panels.figure.bbox)
            for done, number in enumerate(numbers):
                if told is not None:
                    told(done, len(numbers))
                panels.show(0, reader.read(number, fields), float(reader.times[-1]))
                canvas.restore_region(still)
                for artist in moving:
                    axes.draw_artist(artist)
                yield np.asarray(canvas.buffer_rgba())[:, :, :3].copy()

        if path.suffix == ".mp4":
            if write_mp4(images(), path):
                return path
            path = path.with_suffix(".gif")
        write_gif(images(), path, view.map)
    return path


def fields_of(reader: vtkhdf.Reader, settings: OutputSettings) -> list[str]:
    """Return the fields that pictures need, of those that the frames have."""
    wanted = [*_DRAWN, *([] if settings.colour == "speed" else [settings.colour])]
    return [name for name in dict.fromkeys(wanted) if name in reader.fields]


class Pictures(Output):
    """Draws ``snapshot.png``, ``animation.gif`` or ``.mp4`` and ``gauges/<name>.png`` at the end.

    Attributes:
        drawn: the files, after ``finish``.
    """

    def __init__(self, settings: OutputSettings, references: Sequence[Reference] = ()) -> None:
        self.settings = settings
        self.references = tuple(references)
        self.drawn: list[Path] = []

    def finish(self, run: RunLike) -> None:
        if getattr(run, "hurried", False):  # the machine is wanted for something else
            return
        title = str(getattr(run.case, "title", "") or "")
        fluids = [str(fluid.name) for fluid in getattr(run.case, "fluid", ())]
        self.drawn = draw_run(run.folder, self.settings, self.references, title, fluids)


def draw_run(
    folder: Path,
    settings: OutputSettings,
    references: Sequence[Reference] = (),
    title: str = "",
    fluids: Sequence[str] = (),
) -> list[Path]:
    """Draw all pictures of a run folder; return the files."""
    import matplotlib

    drawn: list[Path] = []
    file = folder / frames.FILE
    if file.exists():
        with vtkhdf.Reader(file) as reader:
            drawn.append(_draw_snapshot(reader, folder / "snapshot.png", settings, title, fluids))
            if settings.animation != "none" and len(reader) > 2:
                mp4 = settings.animation == "mp4" or (settings.animation == "auto" and ffmpeg())
                film = folder / f"animation.{'mp4' if mp4 else 'gif'}"
                drawn.append(animate(reader, film, settings, title, fluids=fluids))
    with matplotlib.rc_context(STYLE):
        drawn += plot_gauges(folder, GAUGE_FOLDER, new_figure, references)
    return drawn


def _draw_snapshot(
    reader: vtkhdf.Reader, path: Path, settings: OutputSettings, title: str, fluids: Sequence[str]
) -> Path:
    """Draw up to four instants: a quarter, a half, three quarters and the end of the run."""
    last = len(reader) - 1
    numbers = sorted({round(last * share) for share in (0.25, 0.5, 0.75, 1.0)})
    if len(numbers) == 3:
        numbers = numbers[-2:]
    fields = fields_of(reader, settings)
    return draw_frames([reader.read(n, fields) for n in numbers], path, settings, title, fluids=fluids)
