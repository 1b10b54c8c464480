"""The driver of all validation cases: which runs are still to do, doing them side by side, measuring them."""

from __future__ import annotations

import json
import logging
import math
import platform
import shutil
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from datetime import date
from pathlib import Path
from typing import Any

from spume.outputs import summary
from spume.outputs.disk import replace_text
from spume.validation.folder import Folder, budgets
from spume.validation.processes import leave_if_orphaned, workers
from spume.validation.study import Bar, Measured, Run, Study, order

RUNS = "runs"
"""Folder of the run folders of a study."""
RESULTS = "results.json"
_COMMON = ("output.pictures=false", "output.animation=none", "output.log_interval=10")

Say = Callable[[str], None]


@dataclass(frozen=True)
class Task:
    """A run and the folder where it belongs."""

    run: Run
    folder: Path


@dataclass(frozen=True)
class Verdict:
    """A bar beside what was reached.

    Attributes:
        bar: the bar.
        reached: the value; NaN where no run gave one.
        cells: resolution of the run that gave it.
        quick: whether the limits are those of the quick runs.
        runs: of how many runs it is the mean.
    """

    bar: Bar
    reached: float
    cells: int
    quick: bool
    runs: int = 1

    @property
    def limits(self) -> tuple[float, float]:
        """The smallest and the largest value that hold."""
        if self.quick:
            return self.bar.quick or (-math.inf, math.inf)
        return self.bar.lower, self.bar.upper

    @property
    def holds(self) -> bool:
        """Whether the value lies within the limits."""
        low, high = self.limits
        return low <= self.reached <= high

    @property
    def word(self) -> str:
        """``holds``, ``MISSED``, or ``not judged``."""
        if self.quick and self.bar.quick is None:
            return "not judged"
        return "holds" if self.holds else "MISSED"


def settings_of(run: Run) -> list[str]:
    """Return all keys that a run replaces in its case.

    A repetition takes steps that are 1, 2, … % longer or shorter. Runs that differ in rounding alone are the same until
    the impact, and what the first one makes of it they all do.
    """
    from spume.case import load

    chosen = [*_COMMON, *run.settings]
    if run.repeat == 0:
        return chosen
    factor = 1.0 + 0.01 * ((run.repeat + 1) // 2) * (1 if run.repeat % 2 else -1)
    time = load(run.case, chosen).time
    return [*chosen, f"time.courant={factor * time.courant:.4g}", f"time.travel={factor * time.travel:.4g}"]


def execute(task: Task) -> str:
    """Do a run, or what is left of it; return its status. Called in a process of its own.

    A run that is finished, of the very same case, is not repeated; one that was interrupted goes on.
    """
    from rich.console import Console

    from spume.case import load
    from spume.diagnosis import Diverged
    from spume.run import FAILED, resume, run

    logging.getLogger("spume").setLevel(logging.ERROR)
    quiet = Console(quiet=True)
    case = load(task.run.case, settings_of(task.run))
    state = status_of(task.folder, case.to_toml())
    if state in ("finished", "failed"):
        return state
    try:
        if state == "interrupted":
            return resume(task.folder, threads=1, console=quiet).status
        shutil.rmtree(task.folder, ignore_errors=True)
        return run(case, task.folder, threads=1, console=quiet).status
    except Diverged:
        return FAILED
    except Exception:
        # What ended the run stands in its summary; the other runs go on.
        if status_of(task.folder, case.to_toml()) == FAILED:
            return FAILED
        raise
    finally:
        leave_if_orphaned()


def status_of(folder: Path, case: str) -> str:
    """Return how a run ended: ``finished``, ``failed``, ``interrupted``; ``new`` where it is of another case."""
    try:
        same = (folder / "case.toml").read_text(encoding="utf-8") == case
        status = str(summary.read(folder)["status"])
    except (OSError, ValueError, KeyError):
        return "new"
    if not same:
        return "new"
    if status in ("finished", "failed"):
        return status
    return "interrupted" if (folder / "checkpoint.h5").exists() else "new"


def do(tasks: Sequence[Task], jobs: int, say: Say) -> None:
    """Do runs side by side, each with one thread, in as many processes.

    Raises:
        KeyboardInterrupt: the runs in progress have written checkpoints and go on when called again.
    """
    if not tasks:
        return
    try:
        with workers(jobs) as pool:
            _share(deque(tasks), pool, jobs, say)
    except BrokenProcessPool:
        say("a process was ended from outside, for want of memory perhaps; the same command goes on with the runs")


def _share(queue: deque[Task], pool: ProcessPoolExecutor, jobs: int, say: Say) -> None:
    """Hand out the tasks of a queue to as many processes as there are jobs."""
    waiting: dict[Future[str], Task] = {}
    while queue or waiting:
        # No more than there are processes: one that has a task in hand begins it, whatever ended the one before.
        while queue and len(waiting) < jobs:
            task = queue.popleft()
            waiting[pool.submit(execute, task)] = task
        done, _ = wait(waiting, return_when=FIRST_COMPLETED)
        for future in done:
            task = waiting.pop(future)
            status = _status(future)
            say(f"{task.folder.parent.parent.name}, {task.run.name}: {status} ({len(queue) + len(waiting)} left)")
            if status == "interrupted":
                raise KeyboardInterrupt


def _status(future: Future[str]) -> str:
    """Return how a run ended; what broke outside its steps is told, and the other runs go on."""
    error = future.exception()
    return future.result() if error is None else f"broke, {type(error).__name__}: {error}"[:300]


def tasks_of(study: Study, out: Path, quick: bool) -> list[Task]:
    """Return the runs of a study with their folders."""
    return [Task(run, out / study.name / RUNS / run.name) for run in (study.quick if quick else study.runs)]


def validate(
    chosen: Iterable[Study], out: Path, *, quick: bool, jobs: int, say: Say, run: bool = True
) -> list[dict[str, Any]]:
    """Run studies, measure them, write results, figures and the report; return the results.

    Args:
        chosen: the studies.
        out: folder of everything; of each study a folder in it.
        quick: the coarse runs, with their own limits.
        jobs: runs side by side.
        say: is told of every run that ends.
        run: whether to run what is missing; without, it is left out, and so is a study of which nothing has been run.
    """
    from spume.validation import report

    chosen = [study for study in chosen if study.quick or not quick]
    tasks = [task for study in chosen for task in tasks_of(study, out, quick)]
    missing = [task for task in tasks if not ended(task)]
    if run:
        do(missing, jobs, say)
    found = []
    for study in chosen:
        if not run and all(task in missing for task in tasks_of(study, out, quick)):
            continue
        results, measured = judge(study, tasks_of(study, out, quick), quick)
        folder = out / study.name
        replace_text(folder / RESULTS, json.dumps(results, indent=2, ensure_ascii=False) + "\n")
        report.figure(study, measured, folder / "figure.png")
        found.append(results)
    report.write(out)
    return found


def ended(task: Task) -> bool:
    """Return whether a run has ended already, finished or failed, of the very same case."""
    from spume.case import load

    return status_of(task.folder, load(task.run.case, settings_of(task.run)).to_toml()) in ("finished", "failed")


def judge(study: Study, tasks: Sequence[Task], quick: bool) -> tuple[dict[str, Any], dict[Run, Measured]]:
    """Return the results of a study as JSON takes them, and what was measured of each run that finished.

    Raises:
        CaseError: a folder of which no run has ended.
    """
    measured: dict[Run, Measured] = {}
    runs = []
    for task in tasks:
        folder = Folder(task.folder)
        numbers = folder.summary if ended(task) else {"status": "not run"}
        entry: dict[str, Any] = {
            "name": task.run.name,
            "case": task.run.case,
            "series": task.run.series,
            "cells": task.run.cells,
            "repeat": task.run.repeat,
            "settings": list(task.run.settings),
            **{key: numbers.get(key) for key in _NUMBERS},
        }
        if numbers["status"] == "finished":
            measured[task.run] = study.measure(folder)
            entry["metrics"] = measured[task.run].metrics
            entry["budgets"] = budgets(folder)
        runs.append(entry)
    orders = observed_orders(study, measured)
    verdicts = [verdict(bar, measured, orders, quick) for bar in study.bars]
    results = {
        "case": study.name,
        "number": study.number,
        "title": study.title,
        "length": study.length,
        "reference": study.reference,
        "date": date.today().isoformat(),
        "machine": f"{platform.machine()} {platform.system()}, Python {platform.python_version()}",
        "quick": quick,
        "bars": [
            {
                "metric": v.bar.metric,
                "series": v.bar.series,
                "lower": v.limits[0],
                "upper": v.limits[1],
                "cells": v.cells,
                "meant for cells": v.bar.cells,
                "mean of runs": v.runs,
                "reached": v.reached,
                "verdict": v.word,
            }
            for v in verdicts
        ],
        "orders": [{"series": s, "metric": m, "order": o} for (s, m), o in orders.items()],
        "runs": runs,
    }
    return finite(results), measured


_NUMBERS = (
    "version", "status", "reason", "particles_fluid", "steps", "wall_time_steps", "us_per_fluid_particle_step",
    "pressure_iterations_mean", "pressure_iterations_max", "counts",
)  # fmt: skip


def observed_orders(study: Study, measured: dict[Run, Measured]) -> dict[tuple[str, str], float]:
    """Return the observed order of convergence by series and metric."""
    found = {}
    for series in dict.fromkeys(run.series for run in measured):
        runs = [run for run in measured if run.series == series]
        sizes = list(dict.fromkeys(run.cells for run in runs))
        for metric in study.orders:
            errors = [abs(mean_of(metric, [measured[run] for run in runs if run.cells == size])) for size in sizes]
            found[series, metric] = order(sizes, errors)
    return found


def verdict(bar: Bar, measured: dict[Run, Measured], orders: dict[tuple[str, str], float], quick: bool) -> Verdict:
    """Return a bar beside what the finest run of its series reached, or its repetitions in the mean."""
    runs = sorted((run for run in measured if run.series == bar.series), key=lambda run: run.cells)
    if not runs:
        return Verdict(bar, math.nan, 0, quick)
    finest = [run for run in runs if run.cells == runs[-1].cells]
    if bar.metric.startswith("order: "):
        reached = orders.get((bar.series, bar.metric.removeprefix("order: ")), math.nan)
    else:
        reached = mean_of(bar.metric, [measured[run] for run in finest])
    return Verdict(bar, float(reached), runs[-1].cells, quick, len(finest))


def mean_of(metric: str, measured: Sequence[Measured]) -> float:
    """Return the mean of a metric over repetitions of a run; NaN where one lacks it."""
    return sum(m.metrics.get(metric, math.nan) for m in measured) / len(measured)


def finite(value: Any) -> Any:
    """Return a value with NaN and infinity, which JSON does not know, as None."""
    if isinstance(value, dict):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    if hasattr(value, "item"):
        value = value.item()
    return None if isinstance(value, float) and not math.isfinite(value) else value
