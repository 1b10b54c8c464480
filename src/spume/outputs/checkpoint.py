"""Checkpoints: everything that the next step reads and every file's end, in one file that is whole or not there."""

from __future__ import annotations

import hashlib
import json
import logging
import time
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume.outputs.disk import NotWritten, Sink, need_room, put_in_place
from spume.outputs.frames import _version
from spume.outputs.output import Output, Outputs, OutputSettings, RunLike
from spume.problems import CaseError, Problem

FILE = "checkpoint.h5"
FORMAT = 2
"""Number of the layout; a file of another one is refused."""

LARGEST_SHARE = 0.05
"""The interval grows until writing takes no more than this part of it [1]."""

_SOONEST, _LOST = 5.0, 0.25
"""Early in a run checkpoints come sooner than the interval: after these seconds, or this part of the time so far."""

log = logging.getLogger("spume")


class CheckpointError(CaseError):
    """A run that cannot be continued; the message says why and what to do."""

    def __init__(self, where: Path | str, message: str) -> None:
        super().__init__([Problem(str(where), "", "", message)])


@dataclass(frozen=True)
class Saved:
    """What a checkpoint holds.

    Attributes:
        arrays, numbers: the state of the simulation, as ``Simulation.restore`` takes it.
        outputs: the state of the outputs, as ``Outputs.resume`` takes it.
        case: the completed case, as TOML.
        version: version of Spume that wrote it.
        device, threads, precision: what it was computed on.
        time: t [s].
        step: steps done.
    """

    arrays: Mapping[str, NDArray[Any]]
    numbers: Mapping[str, Any]
    outputs: dict[str, Any]
    case: str
    version: str
    device: str
    threads: int
    precision: str
    time: float
    step: int


class Checkpoint(Output):
    """Writes ``checkpoint.h5`` at an interval of wall time, sooner early in a run, on interruption and at the end.

    A run that fails loses no more than a fifth of what it has computed, or `_SOONEST`, where writing is cheap.
    It looks at the state between two steps, after all other outputs, and changes nothing.

    Attributes:
        seconds: wall time that the last one took [s].
        clock: all outputs of the run.
    """

    def __init__(self, settings: OutputSettings) -> None:
        self.settings = settings
        self.seconds = 0.0
        self.clock: Outputs | None = None
        self._begin = time.monotonic()
        self._next = 0.0
        self._written = -1

    def start(self, run: RunLike) -> None:
        self.write(run)

    def resume(self, run: RunLike, state: dict[str, Any]) -> None:
        self._written = run.simulation.step_index
        self._wait()

    def after_step(self, run: RunLike) -> None:
        if time.monotonic() >= self._next:
            self.write(run)

    def finish(self, run: RunLike) -> None:
        # A step that failed, or was left half-way, must not take the place of the last good state.
        if run.status in ("finished", "interrupted") and getattr(run, "whole", True):
            self.write(run)

    def write(self, run: RunLike) -> None:
        """Write the present state, unless it is the one that was written last.

        Raises:
            NotWritten: the disk is full; the checkpoint before is intact.
        """
        step = run.simulation.step_index
        if self.settings.checkpoint_interval == "none" or self.clock is None or self._written == step:
            return
        begin = time.monotonic()
        case = run.case
        known = run.simulation.snapshot().fields
        fields = {*case.output.of_frame(known), *(name for gauge in case.gauge for name in gauge.read_of(known))}
        arrays, numbers = run.simulation.state(fields)
        if not all(np.isfinite(arrays[f"particles/{name}"]).all() for name in ("position", "velocity")):
            return  # the step that begins will say so
        try:
            saved = Saved(
                arrays, numbers, self.clock.state(), case.to_toml(run.folder), _version(), run.device, run.threads,
                run.precision, run.simulation.time, step,
            )  # fmt: skip
            write(run.folder / FILE, saved)
        except OSError as error:
            raise NotWritten(f"{FILE} cannot be written: {error}") from error
        self._written = step
        self.seconds = time.monotonic() - begin
        self._wait()
        log.debug("checkpoint at step %d, t = %.6g s in %.2f s", step, run.simulation.time, self.seconds)

    def _wait(self) -> None:
        interval = self.settings.checkpoint_interval
        if interval != "none":
            now = time.monotonic()
            early = max(_SOONEST, _LOST * (now - self._begin))
            self._next = now + max(min(interval, early), self.seconds / LARGEST_SHARE)


def write(path: Path, saved: Saved) -> None:
    """Write a checkpoint; the file has its name only when all of it is on the disk.

    Raises:
        OSError: it cannot be written; a file that was there is still there.
    """
    import h5py

    partial = path.with_name(path.name + ".partial")
    need_room(path.parent, sum(values.nbytes for values in saved.arrays.values()))
    try:
        with Sink(partial) as sink:
            with h5py.File(sink, "w") as file:
                file.attrs["format"] = FORMAT
                file.attrs["spume"] = saved.version
                for name in ("device", "threads", "precision", "time", "step"):
                    file.attrs[name] = getattr(saved, name)
                file.attrs["case_sha256"] = hashlib.sha256(saved.case.encode()).hexdigest()
                texts = {"case": saved.case, "numbers": json.dumps(saved.numbers), "outputs": json.dumps(saved.outputs)}
                written = {name: np.frombuffer(text.encode(), dtype=np.uint8) for name, text in texts.items()}
                for name, values in (*written.items(), *saved.arrays.items()):
                    dataset = file.create_dataset(name, data=np.ascontiguousarray(values))
                    dataset.attrs["crc32"] = _checksum(values)
            sink.check()
            sink.sync()
        put_in_place(partial, path)
    except OSError:
        partial.unlink(missing_ok=True)
        raise


def read(folder: Path) -> Saved:
    """Return the checkpoint of a run folder.

    Raises:
        CheckpointError: there is none, or none that this version can read; the message gives the remedy.
    """
    import h5py

    path = folder / FILE
    if not folder.is_dir():
        raise CheckpointError(folder, "no such run folder")
    again = f"start the case again: spume run {folder / 'case.toml'}"
    if not path.exists():
        if not (folder / "case.toml").exists():
            raise CheckpointError(folder, f"no run folder: neither case.toml nor {FILE} is in it")
        raise CheckpointError(folder, f"no {FILE}: the run ended before its first one, or wrote none; {again}")
    try:
        with h5py.File(path, "r", locking=False) as file:
            found = int(file.attrs["format"])
            version = str(file.attrs["spume"])
            if found != FORMAT:
                raise CheckpointError(
                    path,
                    f"written by spume {version} in format {found}; this is spume {_version()}, which reads format "
                    f"{FORMAT}: continue with that version, or {again}",
                )
            arrays: dict[str, NDArray[Any]] = {}

            def visit(name: str, item: Any) -> None:
                if isinstance(item, h5py.Dataset):
                    arrays[name] = item[()]
                    if _checksum(arrays[name]) != int(item.attrs["crc32"]):
                        raise OSError(f"the checksum of {name} is wrong")

            file.visititems(visit)
            case, numbers, outputs = (arrays.pop(n).tobytes().decode() for n in ("case", "numbers", "outputs"))
            return Saved(
                arrays,
                json.loads(numbers),
                json.loads(outputs),
                case,
                version,
                str(file.attrs["device"]),
                int(file.attrs["threads"]),
                str(file.attrs["precision"]),
                float(file.attrs["time"]),
                int(file.attrs["step"]),
            )
    except CheckpointError:
        raise
    except (OSError, KeyError, RuntimeError, ValueError, TypeError) as error:
        raise CheckpointError(path, f"damaged and cannot be read ({error}); {again}") from error


def _checksum(values: NDArray[Any]) -> int:
    return zlib.crc32(np.ascontiguousarray(values).view(np.uint8).data)
