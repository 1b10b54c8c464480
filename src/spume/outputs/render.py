"""Rendered pictures and films of 3D runs: the reconstructed surface of the water, between translucent walls.

Needs the extra ``view`` (PyVista) and OpenGL, which works without a screen.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from spume.outputs import frames, pictures, raster, vtkhdf
from spume.outputs.faces import faces_of
from spume.outputs.output import OutputSettings
from spume.outputs.snapshot import FLUID
from spume.outputs.surface import reconstruct, solid
from spume.problems import CaseError, Problem

if TYPE_CHECKING:
    from spume.results import Results

Floats = NDArray[np.float64]

INSTALL = 'pip install "spume[view]"'

NO_OPENGL = (
    "on Debian and Ubuntu apt install libgl1 libegl1 libosmesa6, elsewhere the Mesa libraries of the system; "
    "spume plot draws without OpenGL"
)
"""What to do where nothing can be rendered."""

_WALL = "#9fb4c4"
_EDGE = "#5b6770"
_OBSTACLE = "#cc8560"


class RenderError(CaseError):
    """A picture that cannot be rendered here; the message says what is missing and the command that mends it."""

    def __init__(self, message: str, key: str = "spume render", value: str = "") -> None:
        super().__init__([Problem("", key, value, message)])


def available() -> tuple[bool, str]:
    """Return whether OpenGL works without a screen, tried in another process, and its name or what it says."""
    code = (
        "import pyvista\n"
        "plotter = pyvista.Plotter(off_screen=True, window_size=(64, 64))\n"
        "plotter.add_mesh(pyvista.Sphere(), color='red')\n"
        "image = plotter.screenshot(return_img=True)\n"
        "assert int(image[32, 32, 0]) > int(image[32, 32, 2]) + 50, 'the picture is empty'\n"
        "print('OK', pyvista.GPUInfo().renderer if hasattr(pyvista, 'GPUInfo') else 'OpenGL')\n"
    )
    try:
        answer = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, errors="replace", timeout=120, check=False
        )
    except subprocess.TimeoutExpired:
        return False, "no answer within 120 s"
    said = next((line[3:] for line in answer.stdout.splitlines() if line.startswith("OK ")), None)
    if answer.returncode == 0 and said is not None:
        return True, said
    last = (answer.stderr.strip().splitlines() or [f"the attempt crashed ({answer.returncode})"])[-1]
    return False, last[:200]


def check_available() -> None:
    """Raise RenderError where PyVista or OpenGL is missing."""
    try:
        import pyvista  # noqa: F401
    except ImportError:
        raise RenderError(f"needs PyVista, which is not installed: {INSTALL}") from None
    works, why = available()
    if not works:
        raise RenderError(f"OpenGL without a screen does not work here ({why}): {NO_OPENGL}")


def render_run(
    results: Results,
    out: Path | None = None,
    *,
    times: Sequence[float] = (),
    film: bool = True,
    settings: OutputSettings | None = None,
    told: Callable[[int, int], None] | None = None,
) -> list[Path]:
    """Render ``render.png`` and, unless `film` is false, ``render.mp4`` of a 3D run; return the files.

    Args:
        results: the run.
        out: folder of the pictures; default: ``plots`` in the run folder. Pictures that exist are replaced.
        times: instants of the picture [s], the frames nearest to them; default: four of the whole run.
        film: render a film of at most 100 frames; a GIF where ffmpeg is missing.
        settings: colours and camera; default: those of the case.
        told: is told how many pictures of the film are done, and of how many.

    Raises:
        RenderError: PyVista or OpenGL is missing, or the run is 2D.
        PlotError: the frames lack the field that is to colour the surface.
        RunFolderError: the run has no frames.
    """
    import matplotlib

    from spume.outputs import figures

    if results.dimension != 3:
        raise RenderError(f"{results.path} is a 2D run: spume plot {results.path} draws it")
    results.at(0.0)  # no frames: says so
    settings = settings or figures.settings_of(results)
    figures.check_colour(results, settings.colour)
    check_available()
    folder = results.path / figures.FOLDER if out is None else Path(out)
    folder.mkdir(parents=True, exist_ok=True)
    chosen = times or [results.times[round((len(results) - 1) * share)] for share in (0.25, 0.5, 0.75, 1.0)]
    some = {frame.index: frame for frame in (results.at(float(t)) for t in chosen)}
    painter = Renderer()
    fluids = figures.fluids_of(results)
    figure = pictures.frames_figure([some[k] for k in sorted(some)], settings, results.title, 150, painter, fluids)
    figure.savefig(folder / "render.png", dpi=150)
    drawn = [folder / "render.png"]
    if film and len(results) > 1:
        with vtkhdf.Reader(results.path / frames.FILE) as reader, matplotlib.rc_context(pictures.STYLE):
            path = folder / "render.mp4"
            drawn.append(pictures.animate(reader, path, settings, results.title, 110, painter, told, fluids))
    painter.close()
    return drawn


class Renderer:
    """Paints frames in 3D, as a `pictures.Painter`; one window serves all of them."""

    def __init__(self) -> None:
        self._plotter: Any = None

    def __call__(self, frame: vtkhdf.Frame, view: pictures.View, shape: tuple[int, int], fine: bool) -> raster.Image:
        """Return the picture of a frame, RGB, of this height and width [pixels]; `fine` takes soft edges."""
        import pyvista

        size = (shape[1], shape[0])
        if self._plotter is None or tuple(self._plotter.window_size) != size:
            self.close()
            _hush()
            self._plotter = pyvista.Plotter(off_screen=True, window_size=size, lighting="light kit")
        plotter = self._plotter
        plotter.clear_actors()
        plotter.set_background("white")
        plotter.enable_depth_peeling(8)
        plotter.enable_anti_aliasing("ssaa" if fine else "msaa")
        self._draw_walls(plotter, frame)
        common = {"cmap": view.map, "clim": (view.low, view.high), "show_scalar_bar": False}
        surface = reconstruct(frame, pictures.values_of(frame, view.settings.colour))
        light = {"ambient": 0.32, "diffuse": 0.75, "specular": 0.35, "specular_power": 25}
        if surface.mesh.n_points:
            mesh = surface.mesh.compute_normals(feature_angle=60.0, split_vertices=True, consistent_normals=False)
            plotter.add_mesh(mesh, scalars="value", smooth_shading=True, **light, **common)
        if len(surface.spray):
            drops = pyvista.PolyData(surface.spray)
            drops["value"] = surface.spray_values
            ball = pyvista.Sphere(radius=0.4 * frame.spacing, theta_resolution=12, phi_resolution=10)
            balls = drops.glyph(geom=ball, scale=False, orient=False)
            plotter.add_mesh(balls, scalars="value", smooth_shading=True, **light, **common)
        self._look(plotter, view, shape)
        return np.ascontiguousarray(plotter.screenshot(return_img=True)[:, :, :3])

    def close(self) -> None:
        """Close the window."""
        if self._plotter is not None:
            self._plotter.close()
            self._plotter = None

    def _draw_walls(self, plotter: Any, frame: vtkhdf.Frame) -> None:
        room, obstacle = walls(frame)
        if room.n_points:
            plotter.add_mesh(room, color=_WALL, opacity=0.16, lighting=False)
            edges = room.extract_feature_edges(feature_angle=40.0, manifold_edges=False, non_manifold_edges=False)
            if edges.n_points:
                plotter.add_mesh(edges, color=_EDGE, line_width=1.5, lighting=False)
        if obstacle.n_points:
            body = obstacle.compute_normals(feature_angle=40.0, split_vertices=True, consistent_normals=False)
            plotter.add_mesh(body, color=_OBSTACLE, ambient=0.3, diffuse=0.7, smooth_shading=True)

    def _look(self, plotter: Any, view: pictures.View, shape: tuple[int, int]) -> None:
        """Take the place from which the other pictures of a run are seen."""
        camera = raster.Camera(view.lower, view.upper, *view.settings.view_deg, shape)
        right, up, eye = camera.axes
        low, high = camera.extent()
        middle = 0.5 * (low + high)
        focus = 0.5 * (view.lower + view.upper) + middle[0] * right + middle[1] * up
        plotter.camera.focal_point = focus
        plotter.camera.position = focus + camera.distance * eye
        plotter.camera.up = up
        half = 0.5 * shape[0] / camera.scale
        plotter.camera.view_angle = 2.0 * float(np.degrees(np.arctan(half / camera.distance)))
        plotter.reset_camera_clipping_range()


def _hush() -> None:
    """Keep VTK from reporting each way of opening a window that it tries in vain before it finds one."""
    from vtkmodules.vtkCommonCore import vtkLogger

    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_ERROR)


def walls(frame: vtkhdf.Frame) -> tuple[Any, Any]:
    """Return the wetted faces of tanks and walls, and the bodies that stand in the water, as PyVista's meshes.

    Of tanks it is what looks at the water, not their outside; a body is reconstructed from its rows as the water is, so
    its edges are rounded by about a spacing.
    """
    import pyvista

    tiles = faces_of(frame)
    shown = ~tiles.obstacle & ~tiles.outer
    room = _tiles(tiles.centre[shown], tiles.first[shown], tiles.second[shown], frame.spacing)
    standing = np.unique(tiles.body[tiles.obstacle])
    if not len(standing):
        return room, pyvista.PolyData()
    l0 = frame.spacing
    solids = np.asarray(frame["kind"]) != FLUID
    position = np.asarray(frame["position"], dtype=float)[solids]
    own = np.isin(np.asarray(frame["body"])[solids], standing)
    obstacle = solid(position[own], position[~own], l0)
    if room.n_points and obstacle.n_points:  # neither the wall beside it nor a foundation is part of it
        for axis, side in ((0, 0), (0, 1), (1, 0), (1, 1), (2, 0)):
            normal, origin = np.zeros(3), np.zeros(3)
            normal[axis] = 1 - 2 * side
            origin[axis] = room.bounds[2 * axis + side] + 0.3 * l0 * normal[axis]
            obstacle = obstacle.clip(normal, origin=origin, invert=False)
    return room, obstacle


def _tiles(centre: Floats, first: Floats, second: Floats, spacing: float) -> Any:
    """Return parallelograms by their middles and sides [m], shape (tiles, 3), their common corners merged."""
    import pyvista

    if len(centre) == 0:
        return pyvista.PolyData()
    corners = [centre + 0.5 * (i * first + j * second) for i, j in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    points = np.stack(corners, axis=1).reshape(-1, 3)
    cells = np.column_stack([np.full(len(centre), 4), np.arange(4 * len(centre)).reshape(-1, 4)])
    return pyvista.PolyData(points, cells.reshape(-1)).clean(tolerance=0.4 * spacing, absolute=True)
