"""Output of all gauges of a case."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from spume.outputs.gauge import Gauge, Recorder
from spume.outputs.output import Output, RunLike
from spume.outputs.snapshot import Snapshot

FOLDER = "gauges"


class Gauges(Output):
    """Writes ``gauges/<name>.csv`` for every gauge of a case.

    Raises:
        ValueError: two gauges of one name, or (at the start) a gauge that does not fit the case.
    """

    def __init__(self, gauges: Sequence[Gauge]) -> None:
        names = [g.name for g in gauges]
        twice = sorted({n for n in names if names.count(n) > 1})
        if twice:
            raise ValueError(f"gauge name = {twice[0]!r}: given to two gauges; every gauge needs its own")
        self.gauges = tuple(gauges)
        self.recorders: tuple[Recorder, ...] = ()

    def start(self, run: RunLike) -> None:
        snapshot = run.simulation.snapshot()
        for gauge in self.gauges:
            gauge.check(snapshot)
        self.recorders = tuple(Recorder(g, path(run.folder, g.name)) for g in self.gauges)
        self.after_step(run)

    def state(self) -> dict[str, Any]:
        return {recorder.gauge.name: recorder.state() for recorder in self.recorders}

    def resume(self, run: RunLike, state: dict[str, Any]) -> None:
        snapshot = self._kept(run.simulation.snapshot())
        self.recorders = tuple(Recorder(g, path(run.folder, g.name)) for g in self.gauges)
        for recorder in self.recorders:
            recorder.resume(snapshot, state[recorder.gauge.name])

    def after_step(self, run: RunLike) -> None:
        if not self.recorders:
            return
        snapshot = run.simulation.snapshot()
        if any(g.interval is not None for g in self.gauges):
            snapshot = self._kept(snapshot)
        for recorder in self.recorders:
            recorder.record(snapshot)

    def _kept(self, snapshot: Snapshot) -> Snapshot:
        """Return a snapshot whose fields outlive their step, as those of the steps around an instant must."""
        return snapshot.keep(tuple({name: None for g in self.gauges for name in g.read_of(snapshot.fields)}))

    def finish(self, run: RunLike) -> None:
        for recorder in self.recorders:
            recorder.close()


def path(folder: Path, name: str) -> Path:
    """Return the CSV file of a gauge in a run folder."""
    return folder / FOLDER / f"{name}.csv"
