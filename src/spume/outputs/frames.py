"""Output of frames at an interval."""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from spume.outputs.output import Output, OutputSettings, RunLike
from spume.outputs.vtkhdf import Writer

FILE = "run.vtkhdf"

log = logging.getLogger("spume")


class Frames(Output):
    """Writes ``run.vtkhdf``: the initial state, then the first step at or after every k interval.

    The last state of a run is always written.
    """

    def __init__(self, settings: OutputSettings) -> None:
        self.settings = settings
        self._writer: Writer | None = None
        self._interval = 0.0
        self._next = 0
        self._written = -1

    def start(self, run: RunLike) -> None:
        end = float(run.case.time.end)
        self._interval = self.settings.interval or end / 100.0
        self._open(run)
        self._write(run)

    def _open(self, run: RunLike) -> None:
        snapshot = run.simulation.snapshot()
        attributes: dict[str, Any] = {
            "title": str(getattr(run.case, "title", "") or ""),
            "creator": f"Spume {_version()}",
            "gravity": snapshot.gravity,
        }
        self._writer = Writer(
            run.folder / FILE, self.settings.of_frame(snapshot.fields), attributes,
            int(np.ceil(float(run.case.time.end) / self._interval)) + 2,
        )  # fmt: skip

    def state(self) -> dict[str, Any]:
        assert self._writer is not None
        return {"interval": self._interval, "next": self._next, "written": self._written, "file": self._writer.state()}

    def resume(self, run: RunLike, state: dict[str, Any]) -> None:
        self._interval, self._next, self._written = state["interval"], state["next"], state["written"]
        path = run.folder / FILE
        try:
            fields = self.settings.of_frame(run.simulation.snapshot().fields)
            self._writer = Writer.reopened(path, fields, state["file"])
        except OSError as error:  # cut short by a full disk: the run goes on, and what there is stays
            aside = path.with_name(f"{FILE}.damaged")
            if path.exists():
                path.replace(aside)
            log.warning("%s: it is kept as %s, frames go on in a new file", error, aside.name)
            self._open(run)
            self._write(run)

    def after_step(self, run: RunLike) -> None:
        # A thousandth of a step early is on time: k interval and the sum of the steps round differently.
        if run.simulation.time >= self._next * self._interval - 1e-3 * run.simulation.dt:
            self._write(run)

    def finish(self, run: RunLike) -> None:
        if self._writer is None:
            return
        try:
            if run.simulation.snapshot().step != self._written:
                self._write(run)
        finally:
            self._writer.close()

    def _write(self, run: RunLike) -> None:
        assert self._writer is not None
        snapshot = run.simulation.snapshot()
        self._writer.write(snapshot)
        self._written = snapshot.step
        t = run.simulation.time + 1e-3 * run.simulation.dt
        self._next = int(np.floor(t / self._interval + 1e-9)) + 1


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("spume")
    except PackageNotFoundError:  # run from a source tree that is not installed
        return "(not installed)"
