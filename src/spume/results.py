"""Results of a run, read back from its folder: ``spume.open("run")``."""

from __future__ import annotations

import json
import operator
import os
import time
import tomllib
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from spume.named import nearest_match
from spume.outputs import frames, log, record, summary, vtkhdf
from spume.outputs.machine import is_computing
from spume.problems import CaseError, Problem
from spume.tables import read_columns

if TYPE_CHECKING:
    import pandas as pd

    from spume.case import Case
    from spume.outputs.reference import Comparison, Reference

__all__ = ["Frame", "Results", "RunFolderError", "open"]

CASE_FILE = "case.toml"
_OURS = (CASE_FILE, summary.FILE, frames.FILE, log.FILE)
_QUIET = 600.0  # seconds without a new line after which a run on another machine counts as ended


class RunFolderError(CaseError):
    """A folder, or a part of one, from which no results can be read; the message says why and what to do."""

    def __init__(self, where: Path | str, message: str) -> None:
        super().__init__([Problem(str(where), "", "", message)])


class _OnDemand(Mapping[str, NDArray[Any]]):
    """Fields of one frame, each read when it is first asked for."""

    def __init__(self, names: tuple[str, ...], read: Callable[[str], NDArray[Any]]) -> None:
        self._names, self._read = names, read
        self._known: dict[str, NDArray[Any]] = {}

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name not in self._names:
            raise KeyError(f"no field {name!r}; the frames have {', '.join(self._names)}")
        if name not in self._known:
            self._known[name] = self._read(name)
        return self._known[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __contains__(self, name: object) -> bool:
        return name in self._names


Frame = vtkhdf.Frame


class _Tables(Mapping[str, Any]):
    """Tables by name, each read when it is first asked for."""

    def __init__(self, what: str, names: tuple[str, ...], read: Callable[[str], Any]) -> None:
        self._what, self._names, self._read = what, names, read
        self._known: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._names:
            raise KeyError(f"no {self._what} {name!r}; the run has {', '.join(self._names) or 'none'}")
        if name not in self._known:
            self._known[name] = self._read(name)
        return self._known[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)

    def __repr__(self) -> str:
        return f"<{self._what}s: {', '.join(self._names) or 'none'}>"


class Results:
    """What a run has written: frames, gauges, log, summary and case.

    It is a sequence of frames: ``len(results)``, ``results[3]``, ``results[-1]``, ``results[::10]``, ``for frame in
    results``, and ``results.at(0.5)`` for the one nearest to a time. Everything is read when it is asked for. It
    shows the run as it was when it was opened; open it again to see what a running one has written since.

    Args:
        path: the run folder.

    Attributes:
        path: the run folder.
        summary: what ``summary.json`` says; empty where there is none.
        status: ``finished``; ``interrupted`` (asked to stop; can be continued); ``failed`` (the simulation
            diverged); ``running``; ``crashed`` (killed: it was running, and is no more); ``incomplete`` (no summary).
        problems: one sentence for everything that is missing, damaged or of another version of Spume.
        times: times of the frames [s], shape (frames,).
        dimension: 2 or 3.
        spacing: l0 [m].

    Raises:
        RunFolderError: no such folder, or one from which nothing can be read; the message says what was found.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        _check(self.path)
        self.problems: list[str] = []
        self.summary: dict[str, Any] = self._read_summary()
        self.document: dict[str, Any] = self._read_document()
        self.times: NDArray[np.float64] = np.zeros(0)
        self._fields: tuple[str, ...] = ()
        self._tables: dict[str | None, tuple[dict[str, NDArray[np.float64]], dict[str, str]]] = {}
        self._units: dict[str, str] = {}
        self.dimension = int(self.summary.get("dimension") or self.document.get("dimension") or 2)
        self.spacing = float(self.summary.get("spacing") or self.document.get("spacing") or float("nan"))
        self._read_frame_list()
        self.status = self._status()
        self._note_version()

    def __repr__(self) -> str:
        span = f", t = {self.times[0]:g} … {self.times[-1]:g} s" if len(self) else ""
        return f"<Results {str(self.path)!r}: {self.status}, {len(self)} frames{span}>"

    def _repr_html_(self) -> str:
        from spume.notebook import results_html

        return results_html(self)

    # ------------------------------------------------------------------------------------------ frames

    def __len__(self) -> int:
        return len(self.times)

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))

    def __getitem__(self, index: Any) -> Any:
        """Return a frame by number, negative from the last, or a list of frames for a slice.

        Raises:
            IndexError: no such frame.
            RunFolderError: the frame is damaged.
        """
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        number = operator.index(index)
        number = len(self) + number if number < 0 else number
        if not 0 <= number < len(self):
            raise IndexError(f"{self.path}: frame {index} of {len(self)}")
        return self._frame(number)

    def at(self, time: float) -> Frame:
        """Return the frame nearest to a time [s], the earlier of two that are as near.

        Raises:
            RunFolderError: the run has no frames.
        """
        if not len(self):
            raise RunFolderError(self.path, f"no frames: {'; '.join(self.problems) or 'the run wrote none'}")
        return self._frame(int(np.argmin(np.abs(self.times - time))))

    @property
    def fields(self) -> tuple[str, ...]:
        """Names of the fields in the frames."""
        return self._fields

    @property
    def units(self) -> dict[str, str]:
        """SI unit of every field."""
        return dict(self._units)

    def _frame(self, number: int) -> Frame:
        def read(name: str) -> NDArray[Any]:
            try:
                with vtkhdf.Reader(self.path / frames.FILE) as reader:
                    return reader.read(number, [name])[name]
            except (OSError, KeyError, ValueError, IndexError, RuntimeError) as error:
                raise RunFolderError(
                    self.path / frames.FILE,
                    f"field {name!r} of frame {number} cannot be read ({_reason(error)}): the file was cut short; "
                    "earlier frames may be whole",
                ) from error

        arrays = _OnDemand(self._fields, read)
        return Frame(float(self.times[number]), number, arrays, self.spacing, self.dimension, self._units)

    # ------------------------------------------------------------------------------------------ tables

    @cached_property
    def gauges(self) -> Mapping[str, pd.DataFrame]:
        """Gauges by name: a pandas frame each, one column per quantity and ``time`` [s].

        ``frame.attrs["units"]`` gives the unit of every column.

        Raises:
            ModuleNotFoundError: a gauge is asked for and pandas is missing; `columns` does without it.
            RunFolderError: the gauge's file is damaged.
        """
        return _Tables("gauge", self.gauge_names, self._pandas)

    @cached_property
    def gauge_names(self) -> tuple[str, ...]:
        """Names of the gauges that have written values, in the order of the case."""
        found = {file.stem for file in (self.path / record.FOLDER).glob("*.csv")}
        named = [str(g.get("name")) for g in _tables_of(self.document, "gauge")]
        return tuple([name for name in named if name in found] + sorted(found - set(named)))

    @cached_property
    def log(self) -> pd.DataFrame:
        """What every step did: time, dt, iterations, energies, limiters' uses; units in ``log.attrs["units"]``.

        Raises:
            ModuleNotFoundError: pandas is missing; `columns` does without it.
            RunFolderError: there is no ``log.csv``, or it is damaged.
        """
        return self._pandas(None)

    def columns(self, name: str | None = None) -> tuple[dict[str, NDArray[np.float64]], dict[str, str]]:
        """Return the columns of a gauge, or of the log without a name, as NumPy arrays, and their units.

        Raises:
            RunFolderError: there is no such gauge, or its file is damaged.
        """
        if name is not None and name not in self.gauge_names:
            known = ", ".join(self.gauge_names) or "none"
            near = nearest_match(name, self.gauge_names)
            raise RunFolderError(self.path, f"no gauge {name!r}; the run has {known}{near}")
        if name not in self._tables:
            file = self.path / log.FILE if name is None else record.path(self.path, name)
            try:
                self._tables[name] = read_columns(file)
            except ValueError as error:
                raise RunFolderError(self.path, str(error)) from error
        columns, units = self._tables[name]
        return dict(columns), dict(units)

    @cached_property
    def reference(self) -> Mapping[str, tuple[pd.DataFrame, ...]]:
        """Series from experiments by the name of the gauge that they are compared with, in SI units.

        A pandas frame has the columns ``time`` [s], the compared quantity, and ``lower`` and ``upper`` where
        there is a band of repeated experiments; ``attrs`` gives ``units``, ``source``, ``label``, ``column`` (of
        the gauge) and ``shift_max`` [s].
        """
        names = tuple(dict.fromkeys(r.gauge for r in self.references))
        return _Tables("reference", names, self._reference)

    @cached_property
    def references(self) -> tuple[Reference, ...]:
        """The case's references whose gauge has values and whose file is there; `problems` names the others."""
        from pydantic import ValidationError

        from spume.outputs.reference import Reference

        found = []
        for index, table in enumerate(_tables_of(self.document, "reference")):
            try:
                made = Reference.model_validate(table, context={"folder": self.path})
                made.load()
            except (ValidationError, ValueError) as error:
                text = error.errors()[0]["msg"] if isinstance(error, ValidationError) else str(error)
                name = table.get("gauge", index)
                self.problems.append(f"the reference of gauge {name!r} ({table.get('file')}) cannot be read: {text}")
                continue
            if made.gauge in self.gauge_names:
                found.append(made)
            else:
                self.problems.append(f"gauge {made.gauge!r}, which has a reference, has written no values")
        return tuple(found)

    @cached_property
    def comparisons(self) -> tuple[Comparison, ...]:
        """How the gauges compare with the references, from the files as they are now, in `references`' order."""
        from spume.outputs.reference import compare

        try:
            return tuple(compare(self.references, self.path))
        except ValueError as error:
            self.problems.append(f"gauges and references cannot be compared: {error}")
            return ()

    def _reference(self, name: str) -> tuple[pd.DataFrame, ...]:
        made = []
        pandas = _pandas()
        for r in self.references:
            if r.gauge != name:
                continue
            series = r.load()
            _, units = self.columns(name)
            column = r.value or next(iter(n for n in units if n != "time"))
            data = {"time": series.time * r.time_scale, column: series.value * r.scale}
            if series.lower is not None and series.upper is not None:
                data |= {"lower": series.lower * r.scale, "upper": series.upper * r.scale}
            table = pandas.DataFrame(data)
            table.attrs = {
                "units": {key: "s" if key == "time" else units.get(column, "") for key in data},
                "source": r.source, "label": r.label, "column": column, "shift_max": r.shift_max * r.time_scale,
            }  # fmt: skip
            made.append(table)
        return tuple(made)

    def _pandas(self, name: str | None) -> pd.DataFrame:
        pandas = _pandas()
        columns, units = self.columns(name)
        table = pandas.DataFrame(columns)
        table.attrs["units"] = units
        return table

    # -------------------------------------------------------------------------------------------- case

    @cached_property
    def case(self) -> Case:
        """The completed case.

        Raises:
            CaseError: there is no ``case.toml``, or none that this version of Spume understands; ``document`` is
                then what can be known of it.
        """
        from spume.case import load

        file = self.path / CASE_FILE
        if not file.is_file():
            raise RunFolderError(self.path, f"no {CASE_FILE}: what was simulated is not known")
        try:
            return load(file)
        except CaseError as error:
            written = self.summary.get("version")
            if written and written != _version():
                note = (
                    f"the run is one of spume {written}, this is spume {_version()}, which reads its case differently"
                )
                raise CaseError([*error.problems, Problem(str(file), "", "", note)]) from None
            raise

    @cached_property
    def case_text(self) -> str:
        """The completed case as the text of its file; empty where there is none."""
        try:
            return (self.path / CASE_FILE).read_bytes().decode("utf-8-sig", errors="replace")
        except OSError:
            return ""

    @property
    def title(self) -> str:
        """The case's title, else the folder's name."""
        said = self.summary.get("title") or self.document.get("title") or ""
        return str(said) or self.path.resolve().name

    # ----------------------------------------------------------------------------------------- reading

    def _read_summary(self) -> dict[str, Any]:
        file = self.path / summary.FILE
        if not file.exists():
            self.problems.append(f"no {summary.FILE}: the run was stopped before it began, or the file was not copied")
            return {}
        try:
            read = json.loads(file.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            self.problems.append(f"{summary.FILE} is damaged: {_reason(error)}")
            return {}
        if not isinstance(read, dict):
            self.problems.append(f"{summary.FILE} is no summary of a run")
            return {}
        return read

    def _read_document(self) -> dict[str, Any]:
        if not (self.path / CASE_FILE).exists():
            self.problems.append(f"no {CASE_FILE}: what was simulated is known from the results only")
            return {}
        try:
            return tomllib.loads(self.case_text)
        except tomllib.TOMLDecodeError as error:
            self.problems.append(f"{CASE_FILE} is damaged: {error}")
            return {}

    def _read_frame_list(self) -> None:
        file = self.path / frames.FILE
        if not file.exists():
            partial = file.with_name(f"{frames.FILE}.partial").exists()
            why = "the run was stopped while it wrote the first frame" if partial else "no frames were written"
            wanted = self.document.get("output", {})
            if not (isinstance(wanted, dict) and wanted.get("frames") is False):
                self.problems.append(f"no {frames.FILE}: {why}")
            return
        try:
            with vtkhdf.Reader(file) as reader:
                self.times, self._fields, self._units = reader.times, reader.fields, reader.units
                self.dimension = reader.dimension
                self.spacing = reader.spacing if np.isfinite(reader.spacing) else self.spacing
        except (OSError, ValueError, KeyError, RuntimeError) as error:
            self.problems.append(f"{frames.FILE} cannot be read: {_reason(error)}")

    def _status(self) -> str:
        said = str(self.summary.get("status") or "")
        if not said:
            return "incomplete"
        if said != "running":
            return said
        computing = is_computing(self.summary.get("environment") or {})
        if computing is None:
            changed = max(p.stat().st_mtime for p in (self.path, *self.path.iterdir()))
            computing = time.time() - changed < _QUIET
        if computing:
            return "running"
        self.problems.append(
            f"the run was killed while it computed, and wrote no end; continue it: spume run --resume {self.path}"
        )
        return "crashed"

    def _note_version(self) -> None:
        written = self.summary.get("version")
        if self.summary and not written:
            self.problems.append(f"{summary.FILE} names no version of Spume")
        elif written and written != _version():
            self.problems.append(f"written by spume {written}, read by spume {_version()}")


def open(folder: str | os.PathLike[str]) -> Results:
    """Open the results of a run, also of one that is running, was killed, or is incomplete.

    Args:
        folder: the run folder.

    Raises:
        RunFolderError: no such folder, or one from which nothing can be read; the message says what was found
            there and what to do.
    """
    return Results(folder)


def _check(path: Path) -> None:
    """Refuse what is no run folder, and say what it is."""
    if not path.exists():
        raise RunFolderError(path, "no such folder; name the folder that spume run has made (--out)")
    if not path.is_dir():
        inside = any((path.parent / name).exists() for name in _OURS)
        remedy = f"name the run folder: {path.parent}" if inside else "name the folder that spume run has made (--out)"
        raise RunFolderError(path, f"a file, not a folder; {remedy}")
    try:
        found = sorted(path.iterdir())
    except OSError as error:
        raise RunFolderError(path, f"cannot be read: {error.strerror}") from None
    names = {entry.name for entry in found}
    if names.isdisjoint({*_OURS, f"{frames.FILE}.partial"}):
        runs = [entry for entry in found if entry.is_dir() and any((entry / name).exists() for name in _OURS)]
        shown = ", ".join(f"{entry.name}/" if entry.is_dir() else entry.name for entry in found[:5])
        more = f" and {len(found) - 5} more" if len(found) > 5 else ""
        holds = f"it holds {shown}{more}" if found else "it is empty"
        remedy = f"a run folder holds {', '.join(_OURS)}"
        if runs:
            remedy = f"there are run folders in it: {', '.join(str(run) for run in runs[:5])}"
        raise RunFolderError(path, f"not a run folder of Spume: {holds}; {remedy}")


def _tables_of(document: Mapping[str, Any], key: str) -> list[dict[str, Any]]:
    tables = document.get(key, [])
    return [table for table in tables if isinstance(table, dict)] if isinstance(tables, list) else []


def _reason(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _version() -> str:
    return frames._version()


def _pandas() -> Any:
    try:
        import pandas
    except ModuleNotFoundError:
        raise ModuleNotFoundError(
            "tables as pandas frames need pandas, which is not installed: pip install pandas; "
            "Results.columns gives the same numbers as NumPy arrays"
        ) from None
    return pandas
