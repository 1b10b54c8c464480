"""Frames of a run in one VTKHDF file (temporal PolyData) that ParaView opens without a converter.

The file survives ``kill -9`` at any instant and can be read while the run goes on:

* it appears under its name only when its first frame is complete;
* room for several frames is allocated ahead, uncompressed, so writing a frame normally changes no
  structure of the file, only raw numbers that no reader looks at yet;
* the attribute ``NSteps``, which tells readers how many frames there are, is raised after everything
  else has been flushed, and only then the list of times grows: VTK (9.7) crashes on a list of times
  that is longer than ``NSteps``, and shows a time of zero for one that is shorter;
* ``libver="earliest"`` keeps no "open for writing" mark that would make readers refuse the file,
  and the file is not locked.

Rows are stored in the order of their ``id``, so a field that did not change since the last frame
(``kind``, ``id``, the walls' ``to_surface`` ...) is not stored again: its offset points to the block
that is there. The list of vertices is stored once for all frames.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume.outputs.disk import Sink, need_room
from spume.outputs.snapshot import FLUID, WALL, Snapshot

DEFAULT_FIELDS = (
    "velocity",
    "pressure",
    "number_density",
    "free_surface",
    "kind",
    "body",
    "material",
    "to_surface",
)
"""Fields written when none are named; ``position`` and ``id`` always are."""

_TOPOLOGIES = ("Vertices", "Lines", "Polygons", "Strips")
_CHUNK_BYTES = 64 * 2**20  # no chunk is larger: room is allocated ahead in such pieces
_LIST = 1024  # steps per chunk of the lists that have one entry per step
_GROWTH = 4  # frames that are allocated ahead at least


class Writer:
    """Writes frames one after the other.

    Args:
        path: the file, ``*.vtkhdf``; it must not exist.
        fields: names of the fields to write besides ``position`` and ``id``; a name that the
            snapshot does not have is an error.
        attributes: text or numbers to store on the file's root group (version, title ...).
        frames: number of frames to expect, to choose how much room to allocate ahead.

    Raises:
        FileExistsError: the file is there already.
        KeyError: a field that the snapshots do not have.
    """

    def __init__(
        self,
        path: Path | str,
        fields: Iterable[str] = DEFAULT_FIELDS,
        attributes: dict[str, Any] | None = None,
        frames: int = 100,
    ) -> None:
        self.path = Path(path)
        if self.path.exists():
            raise FileExistsError(f"{self.path} exists; results are never overwritten")
        self.fields = tuple(dict.fromkeys(f for f in fields if f not in ("position", "id")))
        self.frames_ahead = min(max(_GROWTH, -(-frames // 16)), 32)
        self.steps = 0
        self._attributes = attributes or {}
        self._file: Any = None
        self._sink: Any = None
        self._used: dict[str, int] = {}  # rows written, per dataset
        self._exact: set[str] = set()  # datasets that are never longer than what is written
        self._last: dict[str, tuple[int, NDArray[Any]]] = {}  # offset and values of the last block

    def write(self, snapshot: Snapshot) -> None:
        """Append one frame and flush it."""
        order = np.argsort(snapshot["id"], kind="stable")
        arrays = {"position": _stored(snapshot["position"][order].astype(float))}
        for name in ("id", *self.fields):
            arrays[name] = _stored(snapshot[name][order])
        need_room(self.path.parent, sum(values.nbytes for values in arrays.values()))
        if self._file is None:
            self._create(snapshot, arrays)
        self._append(arrays)
        self._file.flush()
        self._sink.check()
        # Only now may readers know about the frame.
        self.steps += 1
        self._file["VTKHDF/Steps"].attrs.modify("NSteps", np.int64(self.steps))
        self._file.flush()
        self._extend("Steps/Values", np.array([snapshot.time]))
        self._file.flush()
        self._sink.check()
        if self.steps == 1:
            self._publish()

    def state(self) -> dict[str, Any]:
        """Return what `reopened` needs; the frames until now are on the disk then."""
        self._file.flush()
        self._sink.check()
        self._sink.sync()
        last = {name: [offset, len(values)] for name, (offset, values) in self._last.items()}
        return {"frames": self.steps, "ahead": self.frames_ahead, "used": dict(self._used), "last": last}

    @classmethod
    def reopened(cls, path: Path, fields: Iterable[str], state: dict[str, Any]) -> Writer:
        """Return the writer of a file that exists, as it was when `state` was taken; later frames are dropped.

        Raises:
            OSError: the file is gone, or damaged, or lacks frames that it had.
        """
        import h5py

        writer = cls.__new__(cls)
        writer.path = path
        writer.fields = tuple(dict.fromkeys(f for f in fields if f not in ("position", "id")))
        writer.frames_ahead, writer.steps = state["ahead"], state["frames"]
        writer._attributes = {}
        writer._used = dict(state["used"])
        writer._exact = {name for name in writer._used if _is_exact(name.removeprefix("VTKHDF/"))}
        try:
            writer._sink = Sink(path, new=False)
            writer._file = h5py.File(writer._sink, "r+", libver="earliest")
            for name, used in writer._used.items():
                if writer._file[name].shape[0] < used:
                    raise OSError(f"{name} has {writer._file[name].shape[0]} rows, the checkpoint knows of {used}")
            # In the order in which a reader may look at any moment: no list of times longer than NSteps says.
            values = "VTKHDF/Steps/Values"
            for name in (values, *sorted(writer._exact - {values})):
                if writer._file[name].shape[0] > writer._used[name]:
                    writer._file[name].resize(writer._used[name], axis=0)
                writer._file.flush()
                if name == values:
                    writer._file["VTKHDF/Steps"].attrs.modify("NSteps", np.int64(writer.steps))
                    writer._file.flush()
            writer._last = {
                name: (offset, writer._file["VTKHDF/" + _dataset_name(name)][offset : offset + length])
                for name, (offset, length) in state["last"].items()
            }
        except (KeyError, RuntimeError) as error:
            raise OSError(f"{path}: {error}") from error
        return writer

    def close(self) -> None:
        """Give back the room that was not used and close the file."""
        if self._file is None:
            return
        for name, used in self._used.items():
            dataset = self._file[name]
            if dataset.shape[0] > used:
                dataset.resize(used, axis=0)
        self._file.close()
        self._sink.close()
        self._file = None

    def _create(self, snapshot: Snapshot, arrays: dict[str, NDArray[Any]]) -> None:
        import h5py

        self._partial = self.path.with_name(self.path.name + ".partial")
        self._sink = Sink(self._partial)
        self._file = h5py.File(self._sink, "w", libver="earliest")
        root = self._file.create_group("VTKHDF")
        root.attrs["Version"] = np.array([2, 0], dtype=np.int64)
        root.attrs.create("Type", b"PolyData", dtype="S8")
        for key, value in self._attributes.items():
            root.attrs[key] = value
        root.attrs["spacing"] = snapshot.spacing
        root.attrs["dimension"] = snapshot.dimension
        rows = len(arrays["position"])
        integers = (
            "NumberOfPoints",
            *(f"{t}/{n}" for t in _TOPOLOGIES for n in ("NumberOfCells", "NumberOfConnectivityIds")),
        )
        for name in integers:
            self._dataset(name, np.dtype(np.int64), (), _LIST)
        for topology in _TOPOLOGIES:
            self._dataset(f"{topology}/Connectivity", np.dtype(np.int64), (), rows)
            self._dataset(f"{topology}/Offsets", np.dtype(np.int64), (), rows + 1)
            self._extend(f"{topology}/Offsets", np.zeros(1, dtype=np.int64))
        self._extend("Vertices/Connectivity", np.arange(rows))
        self._extend("Vertices/Offsets", np.arange(1, rows + 1))
        for name, values in arrays.items():
            dataset = self._dataset(_dataset_name(name), values.dtype, values.shape[1:], rows, frames=True)
            dataset.attrs["unit"] = snapshot.unit(name)
            dataset.attrs["description"] = snapshot.doc(name)
        self._dataset("Steps/Values", np.dtype(np.float64), (), _LIST)
        for name in ("PartOffsets", "NumberOfParts", "PointOffsets"):
            self._dataset(f"Steps/{name}", np.dtype(np.int64), (), _LIST)
        for name in ("CellOffsets", "ConnectivityIdOffsets"):
            self._dataset(f"Steps/{name}", np.dtype(np.int64), (len(_TOPOLOGIES),), _LIST)
        for name in arrays:
            if name != "position":
                self._dataset(f"Steps/PointDataOffsets/{name}", np.dtype(np.int64), (), _LIST)
        self._file["VTKHDF/Steps"].attrs.create("NSteps", np.int64(0))
        self._file["VTKHDF/Steps/Values"].attrs["unit"] = "s"

    def _dataset(self, name: str, dtype: np.dtype[Any], shape: tuple[int, ...], rows: int, frames: bool = False) -> Any:
        """Make an empty dataset that grows along its first axis, in chunks of about ``rows`` rows."""
        import h5py

        chunk = max(rows, 16)
        if frames:
            per_row = dtype.itemsize * int(np.prod(shape, dtype=int))
            ahead = min(self.frames_ahead, max(1, _CHUNK_BYTES // max(per_row * rows, 1)))
            chunk = min(chunk * ahead, max(_CHUNK_BYTES // per_row, 16))
        properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
        properties.set_chunk((chunk, *shape))
        properties.set_alloc_time(h5py.h5d.ALLOC_TIME_EARLY)
        properties.set_fill_time(h5py.h5d.FILL_TIME_NEVER)
        space = h5py.h5s.create_simple((0, *shape), (h5py.h5s.UNLIMITED, *shape))
        parent = self._file.require_group("VTKHDF/" + name.rpartition("/")[0]) if "/" in name else None
        group = self._file["VTKHDF"] if parent is None else parent
        leaf = name.rpartition("/")[2].encode()
        made = h5py.h5d.create(group.id, leaf, h5py.h5t.py_create(dtype), space, properties)
        self._used["VTKHDF/" + name] = 0
        if _is_exact(name):
            self._exact.add("VTKHDF/" + name)
        return h5py.Dataset(made)

    def _extend(self, name: str, values: NDArray[Any]) -> int:
        """Append values to a dataset and return the offset at which they begin."""
        name = "VTKHDF/" + name
        dataset = self._file[name]
        start = self._used[name]
        stop = start + len(values)
        if stop > dataset.shape[0]:
            # Whole chunks, so that the structure of the file changes only once per chunk. VTK takes the
            # lists of counts and steps whole: they have exactly their length (their chunk is there).
            chunk = 1 if name in self._exact else dataset.chunks[0]
            dataset.resize(-(-stop // chunk) * chunk, axis=0)
        if len(values):
            dataset[start:stop] = values
        self._used[name] = stop
        return start

    def _block(self, name: str, values: NDArray[Any]) -> int:
        """Store a field of this frame, unless it equals the last stored one; return its offset."""
        last = self._last.get(name)
        if last is not None and last[1].shape == values.shape and np.array_equal(last[1], values):
            return last[0]
        offset = self._extend(_dataset_name(name), values)
        self._last[name] = (offset, values)
        return offset

    def _append(self, arrays: dict[str, NDArray[Any]]) -> None:
        rows = len(arrays["position"])
        listed = self._used["VTKHDF/Vertices/Connectivity"]
        if rows > listed:
            self._extend("Vertices/Connectivity", np.arange(listed, rows))
            self._extend("Vertices/Offsets", np.arange(listed + 1, rows + 1))
        one = np.ones(1, dtype=np.int64)
        for topology in _TOPOLOGIES:
            cells = rows if topology == "Vertices" else 0
            self._extend(f"{topology}/NumberOfCells", one * cells)
            self._extend(f"{topology}/NumberOfConnectivityIds", one * cells)
        self._extend("NumberOfPoints", one * rows)
        self._extend("Steps/PointOffsets", one * self._block("position", arrays["position"]))
        for name, values in arrays.items():
            if name != "position":
                self._extend(f"Steps/PointDataOffsets/{name}", one * self._block(name, values))
        self._extend("Steps/NumberOfParts", one)
        self._extend("Steps/PartOffsets", one * self.steps)
        none = np.zeros((1, len(_TOPOLOGIES)), dtype=np.int64)
        self._extend("Steps/CellOffsets", none)
        self._extend("Steps/ConnectivityIdOffsets", none)

    def _publish(self) -> None:
        """Give the file its name, now that it holds a whole frame."""
        import h5py

        self._file.close()
        self._sink.close()
        os.replace(self._partial, self.path)
        self._sink = Sink(self.path, new=False)
        self._file = h5py.File(self._sink, "r+", libver="earliest")


@dataclass(frozen=True)
class Frame:
    """One frame of a file.

    Attributes:
        time: t [s].
        index: number of the frame.
        arrays: field name to values in the order of ``id``; vectors have the run's dimension.
        spacing: l0 [m].
        dimension: 2 or 3.
        units: field name to SI unit.
    """

    time: float
    index: int
    arrays: Mapping[str, NDArray[Any]]
    spacing: float
    dimension: int
    units: dict[str, str]

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.arrays[name]

    def __contains__(self, name: str) -> bool:
        return name in self.arrays

    def __len__(self) -> int:
        return len(self.position)

    def __repr__(self) -> str:
        return f"<Frame {self.index}: t = {self.time:g} s, {len(self)} rows, {', '.join(self.fields)}>"

    def _repr_html_(self) -> str:
        from spume.notebook import frame_html

        return frame_html(self)

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields."""
        return tuple(self.arrays)

    def plot(self, colour: str | None = None, *, dpi: int = 110, **settings: Any) -> Any:
        """Return matplotlib's figure of the particles; see `spume.simulation.Simulation.plot`."""
        from spume.outputs.pictures import plot

        return plot(self, colour, dpi, settings)

    def to_meshio(self) -> Any:
        """Return a ``meshio.Mesh`` with every field; see `spume.outputs.export.to_meshio`."""
        from spume.outputs.export import to_meshio

        return to_meshio(self)

    def to_pyvista(self) -> Any:
        """Return a ``pyvista.PolyData`` with every field; see `spume.outputs.export.to_pyvista`."""
        from spume.outputs.export import to_pyvista

        return to_pyvista(self)

    def to_surface(self, colour: str = "speed") -> Any:
        """Return the surface of the water in 3D as a mesh; see `spume.outputs.export.to_surface`."""
        from spume.outputs.export import to_surface

        return to_surface(self, colour)

    @property
    def position(self) -> NDArray[Any]:
        """Positions of all rows [m], shape (rows, dimension)."""
        return self["position"]

    @property
    def speed(self) -> NDArray[Any]:
        """Speeds of all rows [m/s], shape (rows,)."""
        return np.linalg.norm(self["velocity"], axis=1)

    @property
    def fluid(self) -> NDArray[np.bool_]:
        """Mask of the fluid rows, shape (rows,)."""
        return self["kind"] == FLUID

    @property
    def wall(self) -> NDArray[np.bool_]:
        """Mask of the first solid layer, the rows that carry pressure, shape (rows,)."""
        return self["kind"] == WALL


class Reader:
    """Reads frames of a finished, running or killed run; use as a context manager.

    Raises:
        OSError: no such file, or none that HDF5 can open.
        ValueError: not a file that Spume wrote.
    """

    def __init__(self, path: Path | str) -> None:
        import h5py

        self.path = Path(path)
        self._file: Any = _opened(self.path, h5py)
        root = self._file.get("VTKHDF")
        if root is None or "Steps" not in root:
            self._file.close()
            raise ValueError(f"{self.path}: not a temporal VTKHDF file")
        self._root = root
        self.spacing = float(root.attrs.get("spacing", float("nan")))
        self.dimension = int(root.attrs.get("dimension", 3))
        self.attributes: dict[str, Any] = dict(root.attrs)
        self.fields = ("position", *sorted(root["PointData"]))
        self.units = {n: str(root[_dataset_name(n)].attrs.get("unit", "")) for n in self.fields}
        steps = root["Steps"]
        # A frame counts only if all that belongs to it is there (a copy may have been cut short).
        self.count = min(int(steps.attrs["NSteps"]), steps["Values"].shape[0], root["NumberOfPoints"].shape[0])
        self.times: NDArray[np.float64] = steps["Values"][: self.count]

    def __enter__(self) -> Reader:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __len__(self) -> int:
        return self.count

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def read(self, step: int = -1, fields: Iterable[str] | None = None) -> Frame:
        """Return a frame; a negative number counts from the last.

        A last frame that cannot be read (the file was cut short) is passed over for the one before.

        Raises:
            IndexError: no such frame.
            KeyError: no such field.
        """
        index = self.count + step if step < 0 else step
        if not 0 <= index < self.count:
            raise IndexError(f"{self.path}: frame {step} of {self.count}")
        names = self.fields if fields is None else tuple(fields)
        for name in names:
            if name not in self.fields:
                raise KeyError(f"{self.path}: no field {name!r}; it has {', '.join(self.fields)}")
        try:
            return self._read(index, names)
        except OSError:
            if step >= 0 or index == 0:
                raise
            return self._read(index - 1, names)

    def _read(self, index: int, names: tuple[str, ...]) -> Frame:
        steps = self._root["Steps"]
        rows = int(self._root["NumberOfPoints"][int(steps["PartOffsets"][index])])
        arrays = {}
        for name in names:
            where = "PointOffsets" if name == "position" else f"PointDataOffsets/{name}"
            start = int(steps[where][index])
            values = self._root[_dataset_name(name)][start : start + rows]
            if len(values) < rows:
                raise OSError(f"{self.path}: field {name!r} of frame {index} is not complete")
            if values.ndim == 2 and values.shape[1] == 3:
                values = values[:, : self.dimension]
            arrays[name] = values
        return Frame(
            time=float(steps["Values"][index]),
            index=index,
            arrays=arrays,
            spacing=self.spacing,
            dimension=self.dimension,
            units={n: self.units[n] for n in names},
        )


def read(path: Path | str, step: int = -1, fields: Iterable[str] | None = None) -> Frame:
    """Return one frame of a file; see :meth:`Reader.read`."""
    with Reader(path) as reader:
        return reader.read(step, fields)


def _opened(path: Path, h5py: Any) -> Any:
    """Open for reading; once more after a moment, for a writer may be changing the file right now."""
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file")
    for attempt in range(5):
        try:
            return h5py.File(path, "r", locking=False)
        except OSError:
            if attempt == 4:
                raise
            time.sleep(0.05)
    raise AssertionError("unreachable")


def _dataset_name(field: str) -> str:
    return "Points" if field == "position" else f"PointData/{field}"


def _is_exact(name: str) -> bool:
    """Return whether a dataset always has exactly its length, as VTK takes lists of counts and steps whole."""
    return name.startswith("Steps/") or "NumberOf" in name


def _stored(values: NDArray[Any]) -> NDArray[Any]:
    """Return the values as stored: single precision, 64-bit integers, vectors with three components."""
    integer = values.dtype.kind in "iub"
    stored = values.astype((np.int64 if values.dtype.itemsize > 4 else np.int32) if integer else np.float32)
    if stored.ndim == 2 and stored.shape[1] == 2:
        return np.column_stack([stored, np.zeros(len(stored), dtype=stored.dtype)])
    return stored.reshape(len(stored), -1) if stored.ndim == 3 else stored
