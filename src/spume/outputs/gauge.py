"""Gauges: numbers measured while a run goes on, each with its own interval and CSV file."""

from __future__ import annotations

import csv
import os
import time
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, TextIO

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spume.named import Scheme
from spume.outputs.disk import synced
from spume.outputs.snapshot import Snapshot

_FLUSH_SECONDS = 1.0


class Gauge(Scheme, family="gauge", selector="kind"):
    """Something measured from the state of a run at an instant.

    A subclass says which fields it reads, which columns it gives, and measures. It changes nothing.
    """

    reads: ClassVar[tuple[str, ...]] = ()
    """Fields that ``measure`` uses."""
    reads_if_there: ClassVar[tuple[str, ...]] = ()
    """Fields that ``measure`` uses where the models of the case have them."""

    name: Annotated[str, Field(min_length=1, pattern=r"^[^/\\\s]+$")]
    """Label of the gauge, the name of its CSV file and picture."""
    interval: Annotated[float, Field(gt=0.0)] | None = None
    """Time between two values [s], interpolated from the steps around; default: every step."""

    def read_of(self, fields: Iterable[str]) -> tuple[str, ...]:
        """Return which of a case's fields ``measure`` uses."""
        there = set(fields)
        return (*self.reads, *(name for name in self.reads_if_there if name in there))

    def columns(self, dimension: int) -> dict[str, str]:
        """Return column name to unit; the first is the gauge's principal value."""
        raise NotImplementedError

    def check(self, snapshot: Snapshot) -> None:
        """Raise ValueError where the gauge does not fit the case (a wrong dimension, an unknown body)."""

    def blind(self, snapshot: Snapshot) -> str:
        """Return where the gauge is if no fluid can come to it, as far as the initial rows tell; else an empty text."""
        return ""

    def measure(self, snapshot: Snapshot) -> dict[str, float]:
        """Return column name to value, SI units."""
        raise NotImplementedError

    def vector(self, key: str, value: Sequence[float], dimension: int) -> NDArray[np.float64]:
        """Return a parameter that must have one number per dimension, shape (dimension,).

        Raises:
            ValueError: another length.
        """
        if len(value) != dimension:
            raise ValueError(f"gauge {self.name!r}: {key} = {list(value)}: {dimension} numbers in {dimension}D")
        return np.asarray(value, dtype=float)


class Riding(Gauge):
    """A gauge at a place, which may be fixed to a body that moves."""

    body: str | None = None
    """Body that the gauge rides on; places are given as they are at the start. Default: it rests."""

    def check(self, snapshot: Snapshot) -> None:
        if self.body is not None and self.body not in snapshot.bodies:
            known = ", ".join(repr(b) for b in snapshot.bodies) or "(the case has none)"
            raise ValueError(f"gauge {self.name!r}: body = {self.body!r}: one of {known}")


class Recorder:
    """Writes the values of one gauge to its CSV file.

    Without an interval every step gives a row. With one, the rows are at t = k interval, each
    interpolated linearly between the step before and the step after; only at those two is the gauge
    measured. The step is never shortened to meet an instant.

    Args:
        gauge: what to measure.
        path: the CSV file; the header names columns with their units.
    """

    def __init__(self, gauge: Gauge, path: Path) -> None:
        self.gauge = gauge
        self.path = path
        self._previous: Snapshot | None = None
        self._next = 0  # number of the next instant
        self._file: TextIO | None = None
        self._writer: Any = None
        self._columns: tuple[str, ...] = ()
        self._flushed = 0.0

    def record(self, snapshot: Snapshot) -> None:
        """Take the state after a step (or at the start); it must stay valid until the next call."""
        if self._file is None:
            self._open(snapshot)
        interval = self.gauge.interval
        if interval is None:
            self._write(snapshot.time, self.gauge.measure(snapshot))
            return
        late: dict[str, float] | None = None
        early: dict[str, float] | None = None
        before = self._previous
        # A thousandth of a step of tolerance: 0.1 + 0.2 must not miss the instant 0.3.
        while self._next * interval <= snapshot.time + 1e-3 * snapshot.dt:
            instant = self._next * interval
            if late is None:
                late = self.gauge.measure(snapshot)
            if before is None or instant >= snapshot.time or before.time >= snapshot.time:
                self._write(instant, late)
            else:
                if early is None:
                    early = self.gauge.measure(before)
                share = (instant - before.time) / (snapshot.time - before.time)
                # A value that is not there on one side (NaN) gives none in between.
                self._write(instant, {k: (1.0 - share) * early[k] + share * late[k] for k in late})
            self._next += 1
        self._previous = snapshot

    def state(self) -> dict[str, Any]:
        """Return where the file ends and which instant is next; what was written is on the disk then."""
        assert self._file is not None
        return {"bytes": synced(self._file), "next": self._next}

    def resume(self, snapshot: Snapshot, state: dict[str, Any]) -> None:
        """Go on from the state after the last step, which `snapshot` shows; later lines are dropped.

        Raises:
            OSError: the file is gone, or shorter than it was.
        """
        if self.path.stat().st_size < state["bytes"]:
            raise OSError(f"{self.path}: shorter than the checkpoint knows it, {state['bytes']} bytes")
        os.truncate(self.path, state["bytes"])
        self._columns = tuple(self.gauge.columns(snapshot.dimension))
        self._file = self.path.open("a", newline="", encoding="utf-8")
        self._writer = csv.writer(self._file, lineterminator="\n")
        self._next, self._previous = state["next"], snapshot

    def close(self) -> None:
        """Flush and close the file."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def _open(self, snapshot: Snapshot) -> None:
        columns = self.gauge.columns(snapshot.dimension)
        self._columns = tuple(columns)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self._file = self.path.open("w", newline="", encoding="utf-8")
        self._writer = csv.writer(self._file, lineterminator="\n")
        self._writer.writerow(["time [s]", *(f"{name} [{unit}]" for name, unit in columns.items())])
        interval = self.gauge.interval
        if interval is not None:  # a run that is continued begins in the middle
            self._next = int(np.ceil(snapshot.time / interval - 1e-9))

    def _write(self, t: float, values: dict[str, float]) -> None:
        assert self._file is not None
        self._writer.writerow([f"{t:.9g}", *(f"{values[c]:.9g}" for c in self._columns)])
        now = time.monotonic()
        if now - self._flushed > _FLUSH_SECONDS:
            self._file.flush()
            self._flushed = now
