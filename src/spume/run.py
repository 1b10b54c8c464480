"""The run of a case: the loop over steps, its outputs, its progress and its end."""

from __future__ import annotations

import logging
import math
import os
import signal
import time as wall
import tomllib
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spume import inputs
from spume.build import build
from spume.case import Case, CaseError, load, read
from spume.outputs import Outputs, outputs_of
from spume.outputs.disk import replace_text
from spume.problems import Origin
from spume.progress import Progress
from spume.signals import handled
from spume.toml import flattened

if TYPE_CHECKING:
    from rich.console import Console

    from spume.outputs.checkpoint import Saved
    from spume.results import Results
    from spume.simulation import Simulation

log = logging.getLogger("spume")

FINISHED, INTERRUPTED, FAILED = "finished", "interrupted", "failed"

CHANGEABLE = (
    "time.end", "time.courant", "time.travel", "time.step_max", "output.checkpoint_interval",
    "output.pictures", "output.animation", "output.colour", "output.colour_range", "output.map", "output.view_deg",
    "device", "threads", "title",
)  # fmt: skip
"""Keys that a run may change when it is continued: none of them says what is simulated or what a file holds."""


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
        reason: why it failed or was interrupted.
        failure: where and why it failed, as numbers and text.
        device, threads, precision: what the kernels run on.
        console: where outputs print.
        whole: whether the state is that between two steps; false after an error within one.
        hurried: whether the machine is wanted for something else: no pictures are drawn.
    """

    case: Case
    simulation: Simulation
    folder: Path
    status: str = "running"
    reason: str = ""
    device: str = ""
    threads: int = 1
    precision: str = ""
    console: Any = field(default=None, repr=False)
    failure: dict[str, Any] | None = None
    whole: bool = True
    hurried: bool = False

    @property
    def results(self) -> Results:
        """What the run has written so far, read back."""
        from spume.results import Results

        return Results(self.folder)


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
        FolderExistsError: it exists and holds something, or a file is where a folder above it would be; the message
            gives the remedy.
    """
    if folder.is_dir() and not any(folder.iterdir()):
        return
    if folder.exists():
        free = run_folder(folder.name, folder.parent)
        raise FolderExistsError(
            f"{folder} exists already; nothing is overwritten: choose another folder (--out {free}) or remove it"
        )
    above = next((parent for parent in folder.parents if parent.exists()), folder.parent)
    if not above.is_dir():
        raise FolderExistsError(f"{folder} cannot be made: {above} is a file, not a folder; choose another (--out)")
    try:
        folder.mkdir(parents=True)
    except OSError as error:
        raise OSError(f"{folder} cannot be made: {error.strerror}; choose another folder (--out)") from None


@contextmanager
def claimed(folder: Path) -> Iterator[None]:
    """Make a run folder at once, and take it away again where the run is refused before it has written anything.

    Raises:
        FolderExistsError: see `make_folder`.
    """
    there = folder.exists()
    make_folder(folder)
    try:
        yield
    finally:
        if not there and folder.is_dir() and not any(folder.iterdir()):
            folder.rmdir()


def run(
    case: Case,
    folder: str | os.PathLike[str] | None = None,
    *,
    device: str | None = None,
    threads: int | None = None,
    precision: str | None = None,
    console: Console | None = None,
    max_wall_time: float | None = None,
) -> Run:
    """Run a case to its end and write its results.

    Args:
        case: the case.
        folder: run folder, which must not exist or be empty; default: a new one named after the
            case file (``case`` without one) in the current folder.
        device: overrides the case's.
        threads: overrides the case's.
        precision: overrides the case's.
        console: where the folder and progress are shown; default: nowhere.
        max_wall_time: wall time [s] before whose end the run writes a checkpoint and stops.

    Returns:
        The run, whose ``status`` says how it ended: SIGINT, SIGTERM and the end of the wall time end it
        after the current step; `resume` continues it.

    Raises:
        CaseError: the case cannot be set up.
        FolderExistsError: the folder holds something.
        Diverged: the simulation failed; what was computed until then is written.
        NotWritten: results cannot be written (a full disk); the last checkpoint is intact.
    """
    limit = _Limit(max_wall_time)
    simulation = build(case, device, threads, precision)
    folder = run_folder(case.origin.label or "case") if folder is None else Path(folder)
    make_folder(folder)
    case = inputs.kept(case, folder)
    replace_text(folder / "case.toml", case.to_toml(folder))
    if console is not None:
        console.print(f"{case.title or case.origin.label or 'case'}: results in {folder}", highlight=False)
    this = _described(case, simulation, folder, console)
    outputs = outputs_of(case)
    return _loop(this, outputs, limit, lambda: outputs.start(this))


def resume(
    folder: str | os.PathLike[str],
    overrides: Sequence[str] = (),
    *,
    device: str | None = None,
    threads: int | None = None,
    console: Console | None = None,
    max_wall_time: float | None = None,
) -> Run:
    """Continue a run from its last checkpoint: on the same device and threads as if it had not been interrupted.

    What was written after the checkpoint is dropped and computed again. A finished run goes on where it ended
    if `overrides` say ``time.end=...``.

    Args:
        folder: the run folder.
        overrides: ``"time.end=2.0"``: keys to replace, of those in ``CHANGEABLE``.
        device: default: what the run was computed on.
        threads: default: what the run was computed with.
        console: see `run`.
        max_wall_time: see `run`.

    Raises:
        CaseError: no checkpoint, a damaged one, one of another version, a key that cannot be changed, a
            finished run; the message gives the remedy.
        Diverged, NotWritten: see `run`.
    """
    from spume.outputs import checkpoint, summary

    limit = _Limit(max_wall_time)
    folder = Path(folder)
    saved = checkpoint.read(folder)
    case = load(folder / "case.toml", overrides)
    _check_changes(case, saved, folder)
    if saved.time >= case.time.end * (1.0 - 1e-12):
        if (end := case.time.end) < saved.time * (1.0 - 1e-12) and any(o.startswith("time.end") for o in overrides):
            raise checkpoint.CheckpointError(
                f"--set time.end={end:g}",
                f"lies before the time that the run has reached, t = {saved.time:g} s: a run that is continued goes on "
                f"from there; choose a later end, or start another run: spume run {folder / 'case.toml'}",
            )
        before = folder / summary.FILE
        if overrides or not before.exists() or summary.read(folder)["status"] == FINISHED:
            raise checkpoint.CheckpointError(
                folder,
                f"this run is finished, at t = {saved.time:g} s; to go on: spume run --resume {folder} "
                f"--set time.end={2.0 * saved.time:g}",
            )
    _warn_of_failure(folder, case, saved)
    simulation = build(case, device or saved.device, threads or _same_threads(saved), saved.precision)
    try:
        simulation.restore(saved.arrays, saved.numbers)
    except (KeyError, ValueError, TypeError) as error:
        raise checkpoint.CheckpointError(
            folder / checkpoint.FILE, f"does not fit the case ({error}); start it again: spume run {folder}/case.toml"
        ) from error
    if overrides:
        replace_text(folder / "case.toml", case.to_toml(folder))
    this = _described(case, simulation, folder, console)
    _warn_of_differences(this, saved)
    log.info("continuing %s after step %d, t = %.6g s", folder, saved.step, saved.time)
    outputs = outputs_of(case)
    return _loop(this, outputs, limit, lambda: outputs.resume(this, saved.outputs))


def _described(case: Case, simulation: Simulation, folder: Path, console: Console | None) -> Run:
    from spume import kernels

    on = kernels.runtime()
    return Run(
        case, simulation, folder, device=on.device, threads=on.threads, precision=on.precision, console=console
    )  # fmt: skip


def _loop(this: Run, outputs: Outputs, limit: _Limit, begin: Any) -> Run:
    """Advance to the end, to an interruption or to a failure; tell the outputs."""
    from spume.outputs.disk import NotWritten
    from spume.simulation import Diverged

    simulation = this.simulation
    progress = Progress(this.console, this.case.time.end)
    with _stop_requested() as stop, progress:
        try:
            begin()
            while not simulation.done and not stop.requested:
                if limit.near(getattr(outputs.checkpoint, "seconds", 0.0)):
                    stop.now(f"the wall time of {limit.seconds:g} s is used up")
                    break
                simulation.advance()
                outputs.after_step(this)
                limit.step()
                progress.step(simulation)
            this.status = FINISHED if simulation.done else INTERRUPTED
            if this.status == INTERRUPTED:
                this.reason, this.hurried = stop.reason, stop.hurried
        except BaseException as error:
            outside = isinstance(error, KeyboardInterrupt | NotWritten)
            this.status, this.whole = INTERRUPTED if outside else FAILED, False
            plain = isinstance(error, Diverged | NotWritten)
            this.reason = str(error) if plain else f"{type(error).__name__}: {error}".rstrip(": ")
            this.failure = getattr(error, "details", None) or None
            this.hurried = outside
            progress.close()
            try:  # what was computed until then
                outputs.finish(this)
            except Exception:  # must not hide why the run ended
                log.debug("outputs could not be finished", exc_info=True)
            raise
        progress.close()
        outputs.finish(this)
    return this


# ------------------------------------------------------------------------------------ continuing a run


def _same_threads(saved: Saved) -> int:
    from spume import kernels

    return min(saved.threads, kernels.available_threads())


def _warn_of_differences(this: Run, saved: Saved) -> None:
    from spume.outputs.frames import _version

    for name, was, now in (
        ("device", saved.device, this.device),
        ("threads", saved.threads, this.threads),
        ("version of Spume", saved.version, _version()),
    ):
        if was != now:
            log.warning("%s was %s, is %s: the run goes on, but not bit by bit as it would have", name, was, now)


REMEDIES = ("time.courant", "time.travel", "time.step_max")
"""Of what a continued run may change, what changes the steps that it makes."""


def _warn_of_failure(folder: Path, case: Case, saved: Saved) -> None:
    """Warn where a run that failed is continued as it was: the same steps give the same failure."""
    from spume.outputs import summary

    try:
        before = summary.read(folder)
    except (OSError, ValueError):
        return
    was, now = (dict(flattened(tomllib.loads(text))) for text in (saved.case, case.to_toml(folder)))
    if before.get("status") == FAILED and all(was.get(key) == now.get(key) for key in REMEDIES):
        log.warning(
            "%s: this run failed at t = %.6g s (%s); it will fail again unless %s or %s change, as with: "
            "--set time.courant=%g",
            folder,
            before.get("simulated_time") or math.nan,
            before.get("reason"),
            ", ".join(REMEDIES[:-1]),
            REMEDIES[-1],
            0.5 * case.time.courant,
        )


def _completed(text: str, folder: Path) -> str:
    """Return the text of a saved case as this version writes it: the one that saved it may have had other keys."""
    try:
        return read(tomllib.loads(text), Origin(), folder=folder).to_toml(folder)
    except CaseError:
        return text


def _check_changes(case: Case, saved: Saved, folder: Path) -> None:
    """Refuse a case that differs from the one that was saved in more than a continued run may change."""
    from spume.outputs.checkpoint import CheckpointError

    before = dict(flattened(tomllib.loads(_completed(saved.case, folder))))
    now = dict(flattened(tomllib.loads(case.to_toml(folder))))
    for key in dict.fromkeys((*before, *now)):
        if before.get(key) != now.get(key) and not any(key == k or key.startswith(k + ".") for k in CHANGEABLE):
            given = f"{key} = {now[key]!r}" if key in now else key
            was = repr(before[key]) if key in before else "not given"
            raise CheckpointError(
                f"{folder / 'case.toml'} or --set",
                f"{given}: was {was} when the checkpoint was written; a run that is continued may change only "
                f"{', '.join(CHANGEABLE)}. For another case start another run",
            )


# --------------------------------------------------------------------------------------- stopping a run


class _Limit:
    """The wall time that a run may take: near is when what the end needs would not fit in any more.

    The end needs a step and a checkpoint, each counted twice, and a twentieth of the limit (at most a minute) for
    everything else: starting the program, closing files.
    """

    def __init__(self, seconds: float | None) -> None:
        self.seconds = seconds
        self._begin = self._last = wall.monotonic()
        self._steps: deque[float] = deque(maxlen=50)

    def step(self) -> None:
        """Count a step and its outputs."""
        now = wall.monotonic()
        self._steps.append(now - self._last)
        self._last = now

    def near(self, checkpoint: float) -> bool:
        """Return whether to stop now; `checkpoint` is the wall time of one [s]."""
        if self.seconds is None:
            return False
        if not self._steps:
            self._last = wall.monotonic()  # what came before the first step is no part of it
        needed = 2.0 * (max(self._steps, default=0.0) + checkpoint) + min(60.0, 0.05 * self.seconds)
        return wall.monotonic() - self._begin + needed >= self.seconds


@dataclass
class _Stop:
    """Whether, why and how quickly a run is to stop after its step."""

    requested: bool = False
    reason: str = ""
    hurried: bool = False

    def now(self, reason: str, hurried: bool = True) -> None:
        self.requested, self.reason, self.hurried = True, reason, hurried


_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")


@contextmanager
def _stop_requested() -> Iterator[_Stop]:
    """Yield what says whether one of the signals arrived that ask to stop; a second one interrupts at once."""
    stop = _Stop()

    def request(number: int, frame: Any) -> None:
        if stop.requested:
            raise KeyboardInterrupt
        name = signal.Signals(number).name
        stop.now(f"stopped by {name}", hurried=name != "SIGINT")
        log.warning("stopping after this step; interrupt again to stop at once")

    with handled(_SIGNALS, request):
        yield stop
