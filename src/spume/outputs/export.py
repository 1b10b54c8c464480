"""Frames of a run for other programs: CSV, NumPy, VTU, and the reconstructed surface of the water as a mesh."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from spume.problems import CaseError, Problem

if TYPE_CHECKING:
    from spume.outputs.vtkhdf import Frame

INSTALL = 'pip install "spume[view]"'


class ExportError(CaseError):
    """A frame that cannot be exported so; the message says which argument is wrong and what is allowed."""

    def __init__(self, message: str, value: str = "", key: str = "format") -> None:
        super().__init__([Problem("", key, value, message)])


def to_meshio(frame: Frame) -> Any:
    """Return a frame as a ``meshio.Mesh``: a vertex a row, every field as point data.

    Args:
        frame: the frame; positions and vectors of 2D runs get a third component, zero.

    Raises:
        ExportError: meshio is not installed; the message gives the command that mends it.
    """
    try:
        import meshio
    except ImportError:
        raise ExportError(f"needs meshio, which is not installed: {INSTALL}", "meshio") from None
    points, data = _points(frame)
    return meshio.Mesh(points, {"vertex": np.arange(len(points)).reshape(-1, 1)}, point_data=data)


def to_pyvista(frame: Frame) -> Any:
    """Return a frame as a ``pyvista.PolyData``: a vertex a row, every field as point data, the time as field data.

    Args:
        frame: the frame; positions and vectors of 2D runs get a third component, zero.

    Raises:
        ExportError: PyVista is not installed; the message gives the command that mends it.
    """
    try:
        import pyvista
    except ImportError:
        raise ExportError(f"needs PyVista, which is not installed: {INSTALL}", "pyvista") from None
    points, data = _points(frame)
    cloud = pyvista.PolyData(points)
    for name, values in data.items():
        cloud.point_data[name] = values
    cloud.field_data["time"] = [frame.time]
    return cloud


def to_surface(frame: Frame, colour: str = "speed") -> Any:
    """Return the reconstructed surface of the water of a 3D frame as a ``pyvista.PolyData``.

    Args:
        frame: the frame.
        colour: ``speed`` or a scalar field, which becomes the point data ``value``.

    Raises:
        ExportError: PyVista is not installed, or the frame is 2D.
    """
    if frame.dimension != 3:
        raise ExportError("a surface needs a 3D run", key="surface")
    from spume.outputs.pictures import values_of
    from spume.outputs.surface import reconstruct

    try:
        return reconstruct(frame, values_of(frame, colour)).mesh
    except ImportError:
        raise ExportError(f"needs PyVista, which is not installed: {INSTALL}", "pyvista") from None


def _points(frame: Frame) -> tuple[NDArray[np.float64], dict[str, NDArray[Any]]]:
    """Return positions, shape (rows, 3), and the other fields, vectors with three components."""
    data = {name: _spatial(np.asarray(frame[name])) for name in frame.arrays if name != "position"}
    return _spatial(np.asarray(frame["position"], dtype=float)), data


def _spatial(values: NDArray[Any]) -> NDArray[Any]:
    if values.ndim == 2 and values.shape[1] == 2:
        return np.column_stack([values, np.zeros(len(values), dtype=values.dtype)])
    return values


# ---------------------------------------------------------------------------------------------- files


def columns_of(frame: Frame) -> dict[str, NDArray[Any]]:
    """Return columns of shape (rows,) of a frame by their header: ``x [m]``, ``velocity_x [m/s]``."""
    found: dict[str, NDArray[Any]] = {}
    for name in frame.arrays:
        values, unit = np.asarray(frame[name]), frame.units.get(name) or ("m" if name == "position" else "1")
        if values.ndim == 1:
            found[f"{name} [{unit}]"] = values
            continue
        d = frame.dimension
        parts = "xyz"[:d] if values.shape[1] == d else [str(k) for k in range(values.shape[1])]
        for part, column in zip(parts, values.reshape(len(values), -1).T, strict=False):
            found[f"{part if name == 'position' else f'{name}_{part}'} [{unit}]"] = column
    return found


def _csv(frame: Frame, path: Path) -> None:
    columns = columns_of(frame)
    kinds = ["%d" if values.dtype.kind in "iub" else "%.9g" for values in columns.values()]
    table = np.column_stack([values.astype(float) for values in columns.values()])
    np.savetxt(path, table, fmt=kinds, delimiter=",", header=",".join(columns), comments=f"# t = {frame.time:.9g} s\n")


def _npz(frame: Frame, path: Path) -> None:
    arrays: dict[str, Any] = {name: np.asarray(frame[name]) for name in frame.arrays}
    np.savez_compressed(path, time=frame.time, spacing=frame.spacing, **arrays)


def _vtu(frame: Frame, path: Path) -> None:
    to_meshio(frame).write(path)


FORMATS: Mapping[str, Callable[[Frame, Path], None]] = {"csv": _csv, "npz": _npz, "vtu": _vtu}
"""Formats of particles."""

SURFACES = ("ply", "stl", "vtp", "obj")
"""Formats of the reconstructed surface."""


def export(
    frames: Iterable[Frame], folder: Path, file_format: str, fields: Sequence[str] = (), colour: str = "speed"
) -> list[Path]:
    """Write a file per frame, ``frame-0012.vtu``; return the files.

    Args:
        frames: the frames.
        folder: where the files go; it is made. Files that exist are replaced.
        file_format: ``csv``, ``npz`` or ``vtu`` of the particles; ``ply``, ``stl``, ``vtp`` or ``obj`` of the
            reconstructed surface of the water (3D).
        fields: fields besides the position; default: all that the frames have.
        colour: what colours the surface.

    Raises:
        ExportError: an unknown format or field, a missing extra, or the surface of a 2D run.
    """
    if file_format not in FORMATS and file_format not in SURFACES:
        known = f"one of {', '.join(FORMATS)} (particles), {', '.join(SURFACES)} (surface of the water, 3D)"
        raise ExportError(known, repr(file_format))
    written = []
    for frame in frames:
        for name in fields:
            if name not in frame:
                raise ExportError(f"one of {', '.join(frame.fields)}", repr(name), "field")
        path = folder / f"frame-{frame.index:04d}.{file_format}"
        folder.mkdir(parents=True, exist_ok=True)
        if file_format in FORMATS:
            FORMATS[file_format](_chosen(frame, fields), path)
        else:
            mesh = to_surface(frame, colour)
            if mesh.n_points == 0:  # all spray: no format holds nothing
                continue
            mesh.save(path)
        written.append(path)
    return written


def _chosen(frame: Frame, fields: Sequence[str]) -> Frame:
    from dataclasses import replace

    names = ["position", *fields] if fields else list(frame.arrays)
    return replace(frame, arrays={name: frame[name] for name in names})
