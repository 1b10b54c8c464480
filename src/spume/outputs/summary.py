"""Output of the numbers of a whole run: ``summary.json``."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from spume.outputs.disk import replace_text
from spume.outputs.frames import _version
from spume.outputs.log import Log, is_count
from spume.outputs.machine import environment
from spume.outputs.output import Output, Outputs, RunLike
from spume.outputs.reference import Compare

FILE = "summary.json"


class Summary(Output):
    """Writes ``summary.json`` at the start and, complete, at the end.

    ``sessions`` counts the processes that computed the run. ``wall_time`` is that of the whole run,
    ``wall_time_steps`` that of the steps without outputs and without the compilation of kernels: what the
    first three steps of a process took beyond the median of the others is ``wall_time_compilation``.
    ``us_per_fluid_particle_step`` is ``wall_time_steps`` over the sum of fluid particles over all steps.
    ``volume_drift`` is relative to the first step; ``environment`` is that of the last process. In a run that was
    continued all times and counts are those of the work that was kept: what came after a checkpoint and was lost
    is not counted.
    """

    def __init__(self, log: Log, compare: Compare) -> None:
        self.log = log
        self.compare = compare
        self.clock: Outputs | None = None
        self._fluid_steps = 0
        self._fluid = 0
        self._count = 0
        self._solves = 0
        self._iterations = 0
        self._iterations_max: int | None = None
        self._limiters: dict[str, int] = {}
        self._sessions = 1
        self._memory = 0
        self._environment = environment()

    def start(self, run: RunLike) -> None:
        snapshot = run.simulation.snapshot()
        self._fluid = int(snapshot.fluid.sum())
        self._count = len(snapshot)
        self._write(run)

    def state(self) -> dict[str, Any]:
        names = ("fluid_steps", "fluid", "solves", "iterations", "iterations_max", "limiters", "sessions")
        return {name: getattr(self, f"_{name}") for name in names} | {"memory": max(self._memory, peak_memory() or 0)}

    def resume(self, run: RunLike, state: dict[str, Any]) -> None:
        for name, value in state.items():
            setattr(self, f"_{name}", value)
        self._sessions += 1
        self._count = len(run.simulation.snapshot())
        self._write(run)

    def after_step(self, run: RunLike) -> None:
        statistics = run.simulation.statistics
        iterations = int(statistics.get("iterations", 0))
        self._solves += 1
        self._iterations += iterations
        self._iterations_max = max(iterations, self._iterations_max or 0)
        for name, value in statistics.items():
            if is_count(name, value):
                self._limiters[name] = self._limiters.get(name, 0) + int(value)
        if run.simulation.step_index % self.log.interval == 0:
            self._fluid = int(run.simulation.snapshot().fluid.sum())
        self._fluid_steps += self._fluid

    def finish(self, run: RunLike) -> None:
        self._count = len(run.simulation.snapshot())
        self._write(run)

    def _write(self, run: RunLike) -> None:
        path = run.folder / FILE
        text = json.dumps(self.numbers(run), indent=2, ensure_ascii=False, allow_nan=False) + "\n"
        replace_text(path, text)

    def numbers(self, run: RunLike) -> dict[str, Any]:
        """Return what the file says."""
        simulation = run.simulation
        times = self.clock.times() if self.clock else {}
        wall_time_steps = times.get("steps", 0.0)
        drift = self.log.volume / self.log.initial_volume - 1.0 if self.log.initial_volume > 0.0 else None
        numbers = {
            "version": _version(),
            "title": str(getattr(run.case, "title", "") or ""),
            "status": run.status,
            "reason": getattr(run, "reason", "") or None,
            "failure": getattr(run, "failure", None),
            "sessions": self._sessions,
            "device": str(getattr(run, "device", "")),
            "threads": getattr(run, "threads", None),
            "precision": str(getattr(run, "precision", "")),
            "dimension": simulation.snapshot().dimension,
            "spacing": simulation.snapshot().spacing,
            "particles_total": self._count,
            "particles_fluid": self._fluid,
            "steps": simulation.step_index,
            "simulated_time": simulation.time,
            "wall_time": times.get("wall", 0.0),
            "wall_time_steps": wall_time_steps,
            "wall_time_compilation": times.get("compilation", 0.0),
            "wall_time_outputs": times.get("outputs", 0.0),
            "us_per_fluid_particle_step": (1e6 * wall_time_steps / self._fluid_steps if self._fluid_steps else None),
            "pressure_iterations_mean": self._iterations / self._solves if self._solves else None,
            "pressure_iterations_max": self._iterations_max,
            "peak_memory_bytes": max(self._memory, peak_memory() or 0) or None,
            "volume_drift": drift,
            "counts": self._limiters,
            "environment": self._environment,
            "stage_times": {k: float(v) for k, v in getattr(simulation, "stage_times", {}).items()},
            "comparison": [c.to_json() for c in self.compare.results],
        }
        return {k: _finite(v) for k, v in numbers.items()}


def read(folder: Path | str) -> dict[str, Any]:
    """Return the summary of a run folder."""
    return json.loads((Path(folder) / FILE).read_text(encoding="utf-8"))


def _finite(value: Any) -> Any:
    """Return the value with NaN and infinity, which JSON does not know, as None."""
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    if isinstance(value, np.generic):
        value = value.item()
    return None if isinstance(value, float) and not np.isfinite(value) else value


def peak_memory() -> int | None:
    """Return the largest amount of memory that the process has held so far [bytes]; None if unknown."""
    if sys.platform == "win32":
        return _peak_memory_windows()
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(peak) * (1 if sys.platform == "darwin" else 1024)


def _peak_memory_windows() -> int | None:
    import ctypes

    class Counters(ctypes.Structure):
        _fields_ = [
            ("cb", ctypes.c_ulong),
            ("PageFaultCount", ctypes.c_ulong),
            *(
                (name, ctypes.c_size_t)
                for name in ("PeakWorkingSetSize", "WorkingSetSize", "a", "b", "c", "d", "e", "f")
            ),
        ]

    counters = Counters()
    counters.cb = ctypes.sizeof(counters)
    windll: Any = getattr(ctypes, "windll", None)
    windll.kernel32.GetCurrentProcess.restype = ctypes.c_void_p
    process = ctypes.c_void_p(windll.kernel32.GetCurrentProcess())
    ok = windll.psapi.GetProcessMemoryInfo(process, ctypes.byref(counters), counters.cb)
    return int(counters.PeakWorkingSetSize) if ok else None
