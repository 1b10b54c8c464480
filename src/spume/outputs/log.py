"""Output of one line per step: what the step did and how much of everything there is."""

from __future__ import annotations

import csv
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TextIO

from spume.outputs import budgets
from spume.outputs.disk import put_in_place, synced
from spume.outputs.output import Output, RunLike

FILE = "log.csv"
UNITS = {
    "step": "1",
    "time": "s",
    "dt": "s",
    "iterations": "1",
    "residual": "1",
    "volume": "",  # depends on the dimension
    "kinetic_energy": "",
    "potential_energy": "",
    "removed": "1",
    "particles_fluid": "1",
}
"""Columns that every log has; the simulation's other statistics (uses of limiters) follow."""

_FLUSH_SECONDS = 1.0


class Log(Output):
    """Writes ``log.csv``: step, t, dt, iterations, residual, volume, energies, removed particles, and the
    number of uses of every limiter, as ``simulation.statistics`` gives them.

    ``removed`` and the limiters' uses are totals since the line before. A statistic that first
    appears later adds a column; the lines before are zero there.

    Args:
        interval: steps between two lines.
    """

    def __init__(self, interval: int = 1) -> None:
        self.interval = interval
        self.initial_volume = float("nan")
        self.volume = float("nan")
        self._path = Path()
        self._file: TextIO | None = None
        self._columns: list[str] = []
        self._sums: dict[str, Any] = {}
        self._flushed = 0.0
        self._lines = 0

    def start(self, run: RunLike) -> None:
        self._name_units(run)
        self._columns = list(UNITS)
        self._file = self._path.open("w", newline="", encoding="utf-8")
        csv.writer(self._file, lineterminator="\n").writerow(self._header())
        self._file.flush()

    def _name_units(self, run: RunLike) -> None:
        self._path = run.folder / FILE
        snapshot = run.simulation.snapshot()
        d = snapshot.dimension
        joule = "J" if d == 3 else "J/m"
        of_dimension = {"volume": f"m^{d}", "kinetic_energy": joule, "potential_energy": joule}
        # A statistic that has the name of a field has its unit.
        self._units = {name: snapshot.unit(name) for name in snapshot.fields} | UNITS | of_dimension

    def state(self) -> dict[str, Any]:
        synced(self._file)
        names = ("columns", "sums", "lines")
        volumes = {"initial_volume": self.initial_volume, "volume": self.volume}
        return {name: getattr(self, f"_{name}") for name in names} | volumes

    def resume(self, run: RunLike, state: dict[str, Any]) -> None:
        self._name_units(run)
        self._columns, self._sums, self._lines = list(state["columns"]), dict(state["sums"]), state["lines"]
        self.initial_volume, self.volume = state["initial_volume"], state["volume"]
        # Columns that came after the checkpoint go with the lines that came after it.
        self._rewrite(lambda lines: (line[: len(self._columns)] for line in lines[: self._lines]))

    def after_step(self, run: RunLike) -> None:
        simulation = run.simulation
        statistics = dict(simulation.statistics)
        for name, value in statistics.items():
            if name in _OWN:
                continue
            # Counts are added up between two lines, anything else is the last step's.
            before = self._sums.get(name, 0) if is_count(name, value) else 0
            self._sums[name] = before + value
        if simulation.step_index % self.interval:
            return
        snapshot = simulation.snapshot()
        self.volume = budgets.volume(snapshot)
        if simulation.step_index > 0 and not self.initial_volume > 0.0:
            # The first number densities are those of the first step.
            self.initial_volume = self.volume
        row: dict[str, Any] = {
            "step": simulation.step_index,
            "time": simulation.time,
            "dt": simulation.dt,
            "iterations": statistics.get("iterations", 0),
            "residual": statistics.get("residual", 0.0),
            "volume": self.volume,
            "kinetic_energy": budgets.kinetic_energy(snapshot),
            "potential_energy": budgets.potential_energy(snapshot),
            "removed": 0,
            "particles_fluid": int(snapshot.fluid.sum()),
        }
        row.update(self._sums)
        self._sums = dict.fromkeys(self._sums, 0)
        new = [name for name in row if name not in self._columns]
        if new:
            self._widen(new)
        assert self._file is not None
        csv.writer(self._file, lineterminator="\n").writerow(_text(row.get(c, 0)) for c in self._columns)
        self._lines += 1
        now = time.monotonic()
        if now - self._flushed > _FLUSH_SECONDS:
            self._file.flush()
            self._flushed = now

    def finish(self, run: RunLike) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None

    def _header(self) -> list[str]:
        return [f"{c} [{self._units.get(c, '1')}]" for c in self._columns]

    def _widen(self, names: list[str]) -> None:
        """Add columns to the file."""
        assert self._file is not None
        self._file.close()
        self._columns += names
        self._rewrite(lambda lines: (line + ["0"] * len(names) for line in lines))

    def _rewrite(self, change: Callable[[list[list[str]]], Iterable[list[str]]]) -> None:
        """Replace the lines of the file, in one go: a run that is killed meanwhile loses none."""
        with self._path.open(newline="", encoding="utf-8") as file:
            lines = list(csv.reader(file))[1:]
        if len(lines) < self._lines:
            raise OSError(f"{self._path}: {len(lines)} lines, but the checkpoint knows of {self._lines}")
        partial = self._path.with_name(FILE + ".partial")
        with partial.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(self._header())
            writer.writerows(change(lines))
            synced(file)
        put_in_place(partial, self._path)
        self._file = self._path.open("a", newline="", encoding="utf-8")


def is_count(name: str, value: float) -> bool:
    """Return whether a statistic of a step counts something: whatever is whole and no measure of the step."""
    return name not in _MEASURES and float(value).is_integer()


_MEASURES = frozenset({"step", "time", "dt", "iterations", "residual", "air_pockets", "air_pressure"})
_OWN = frozenset(UNITS) - {"removed"}


def _text(value: float | int) -> str:
    if float(value).is_integer():
        return str(int(value))
    return f"{float(value):.9g}"
