"""The run of a case: the loop over steps, its outputs, its progress and its end."""

from __future__ import annotations

import logging
import os
import signal
import threading
import time as wall
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spume.build import build
from spume.case import Case
from spume.outputs import outputs_of
from spume.particles import FLUID
from spume.schemes.gradient.base import tension_bearing

if TYPE_CHECKING:
    from rich.console import Console

    from spume.simulation import Simulation

log = logging.getLogger("spume")

FINISHED, INTERRUPTED, FAILED = "finished", "interrupted", "failed"


class FolderExistsError(FileExistsError):
    """The run folder that was asked for already holds a run."""


@dataclass
class Run:
    """A case that is being run; what outputs see.

    Attributes:
        case: the case.
        simulation: the simulation, between two steps.
        folder: the run folder.
        status: ``running``, then ``finished``, ``interrupted`` or ``failed``.
        reason: why it failed.
        device, threads, precision: what the kernels run on.
        case_folder: where files that the case names are; they are absolute already.
        console: where outputs print.
    """

    case: Case
    simulation: Simulation
    folder: Path
    status: str = "running"
    reason: str = ""
    device: str = ""
    threads: int = 1
    precision: str = ""
    case_folder: Path | None = None
    console: Any = field(default=None, repr=False)


def run_folder(name: str, parent: Path | None = None) -> Path:
    """Return the folder of a new run: ``name``, or ``name-2``, ``name-3`` … where that exists."""
    parent = Path.cwd() if parent is None else parent
    folder, number = parent / name, 2
    while folder.exists():
        folder, number = parent / f"{name}-{number}", number + 1
    return folder


def make_folder(folder: Path) -> None:
    """Make a run folder; an empty one may exist.

    Raises:
        FolderExistsError: it exists and holds something; the message gives the remedy.
    """
    if folder.is_dir() and not any(folder.iterdir()):
        return
    if folder.exists():
        free = run_folder(folder.name, folder.parent)
        raise FolderExistsError(
            f"{folder} exists already; nothing is overwritten: choose another folder (--out {free}) or remove it"
        )
    folder.mkdir(parents=True)


def run(
    case: Case,
    folder: str | os.PathLike[str] | None = None,
    *,
    device: str | None = None,
    threads: int | None = None,
    precision: str | None = None,
    console: Console | None = None,
) -> Run:
    """Run a case to its end and write its results.

    Args:
        case: the case.
        folder: run folder, which must not exist or be empty; default: a new one named after the
            case file (``case`` without one) in the current folder.
        device, threads, precision: override the case's.
        console: where progress is shown; default: nowhere.

    Returns:
        The run, whose ``status`` says how it ended: SIGINT and SIGTERM end it after the current step.

    Raises:
        CaseError: the case cannot be set up.
        FolderExistsError: the folder holds something.
        Diverged: the simulation failed; what was computed until then is written.
    """
    from spume import kernels
    from spume.simulation import Diverged

    simulation = build(case, device, threads, precision)
    runtime = kernels.runtime()
    folder = run_folder(case.origin.label or "case") if folder is None else Path(folder)
    make_folder(folder)
    (folder / "case.toml").write_text(case.to_toml(), encoding="utf-8")
    this = Run(
        case,
        simulation,
        folder,
        device=runtime.device,
        threads=runtime.threads,
        precision=runtime.precision,
        console=console,
    )
    outputs = outputs_of(case)
    progress = Progress(console, case.time.end)
    clipping = Clipping()
    with _stop_requested() as stop, progress:
        try:
            outputs.start(this)
            while not simulation.done and not stop():
                simulation.advance()
                clipping.watch(simulation)
                outputs.after_step(this)
                progress.step(simulation)
            this.status = FINISHED if simulation.done else INTERRUPTED
        except BaseException as error:
            this.status = INTERRUPTED if isinstance(error, KeyboardInterrupt) else FAILED
            this.reason = str(error) if isinstance(error, Diverged) else f"{type(error).__name__}: {error}"
            progress.close()
            try:  # what was computed until then
                outputs.finish(this)
            except Exception:  # must not hide why the run ended
                log.debug("outputs could not be finished", exc_info=True)
            raise
        progress.close()
        outputs.finish(this)
    return this


@contextmanager
def _stop_requested() -> Iterator[Callable[[], bool]]:
    """Yield a function that says whether SIGINT or SIGTERM arrived; a second one interrupts at once."""
    requested = False

    def request(number: int, frame: Any) -> None:
        nonlocal requested
        if requested:
            raise KeyboardInterrupt
        requested = True
        log.warning("stopping after this step; interrupt again to stop at once")

    if threading.current_thread() is not threading.main_thread():  # signals belong to the main thread
        yield lambda: False
        return
    before = {number: signal.signal(number, request) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield lambda: requested
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class Clipping:
    """Warns, once in a run, that many pressures inside the fluid are negative and set to zero."""

    bar = 0.01
    """Part of the rows inside the fluid, in one step, above which it warns [1]."""

    def __init__(self) -> None:
        self.warned = False

    def watch(self, simulation: Any) -> None:
        """Look at the step that was done."""
        clipped = simulation.statistics.get("clipped", 0)
        if self.warned or not clipped:
            return
        fluid = (simulation.fetch("kind") & FLUID) != 0
        inside = max(int((simulation.fetch("free_surface")[fluid] == 0).sum()), 1)
        if clipped > self.bar * inside:
            self.warned = True
            log.warning(
                "step %d: the pressure of %d of %d particles inside the fluid (%.1f %%) was negative and set to zero, "
                "which is a force that the flow does not have: set step.negative_pressure = true with a gradient "
                "that bears tension (%s), or expect noise; log.csv counts them (said once)",
                simulation.step_index, clipped, inside, 100.0 * clipped / inside, ", ".join(tension_bearing()),
            )  # fmt: skip


class Progress:
    """Shows how far a run is: a bar in a terminal, a short line for every tenth otherwise.

    The time left is the simulated time left over the speed of the last minute (simulated seconds per
    second of wall time), outputs included; nothing is said before five steps, which compile kernels.

    Args:
        console: where to show it; None: nowhere.
        end: time at which the run ends [s].
    """

    def __init__(self, console: Console | None, end: float) -> None:
        self.console = console
        self.end = end
        self._bar: Any = None
        self._task: Any = None
        self._history: deque[tuple[float, float]] = deque()
        self._steps = 0
        self._tenth = 0
        self._shown = 0.0

    def __enter__(self) -> Progress:
        if self.console is not None and self.console.is_terminal:
            from rich.progress import BarColumn, TextColumn
            from rich.progress import Progress as Bar

            text = TextColumn("{task.fields[figures]}")
            self._bar = Bar(BarColumn(), TextColumn("{task.percentage:>3.0f} %"), text, console=self.console)
            self._task = self._bar.add_task("", total=self.end, figures="compiling kernels …")
            self._bar.start()
        return self

    def __exit__(self, *exception: object) -> None:
        self.close()

    def close(self) -> None:
        """Take the bar away, so that others may print."""
        if self._bar is not None:
            self._bar.stop()
            self._bar = None

    def step(self, simulation: Any) -> None:
        """Tell of a step."""
        self._steps += 1
        now = wall.monotonic()
        if self._steps > 4:
            self._history.append((now, simulation.time))
            while now - self._history[0][0] > 60.0 and len(self._history) > 2:
                self._history.popleft()
        if self.console is None:
            return
        if self._bar is not None:
            if now - self._shown > 0.1:
                self._shown = now
                self._bar.update(self._task, completed=simulation.time, figures=self.figures(simulation))
            return
        tenth = int(10.0 * simulation.time / self.end + 1e-9)
        if tenth > self._tenth:
            self._tenth = tenth
            self.console.print(f"{10 * tenth:3d} %  {self.figures(simulation)}", highlight=False)

    def figures(self, simulation: Any) -> str:
        """Return simulated time, step, iterations and time left as one line."""
        iterations = simulation.statistics.get("iterations", 0)
        text = f"t = {simulation.time:.4g} / {self.end:g} s, dt = {simulation.dt:.2g} s, "
        text += f"{iterations:.0f} iterations"
        left = self.left()
        return text if left is None else f"{text}, {duration(left)} left"

    def left(self) -> float | None:
        """Return the wall time [s] that the rest will take; None while that is not known."""
        if len(self._history) < 5:
            return None
        (t0, s0), (t1, s1) = self._history[0], self._history[-1]
        if s1 <= s0:
            return None
        return max(0.0, (self.end - s1) * (t1 - t0) / (s1 - s0))


def duration(seconds: float) -> str:
    """Return a wall time in words: ``48 s``, ``12 min``, ``3 h 20 min``."""
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60.0)
    return f"{minutes} min" if minutes < 100 else f"{minutes // 60} h {minutes % 60:02d} min"
