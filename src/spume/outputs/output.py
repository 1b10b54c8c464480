"""What an output is, and the settings of a case's ``[output]`` table."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol

import numpy as np
from pydantic import Field

from spume.named import Parameters
from spume.outputs.disk import NotWritten
from spume.outputs.snapshot import FieldLike, Snapshot
from spume.outputs.vtkhdf import DEFAULT_FIELDS

MapName = Literal["water", "viridis", "cividis", "magma", "inferno", "plasma", "Blues", "turbo", "coolwarm"]


class OutputSettings(Parameters):
    """What a run writes besides its gauges."""

    interval: Annotated[float, Field(gt=0.0)] | None = None
    """Time between two frames [s]; default: a hundredth of the simulated time. A frame is written at the
    first step at or after each instant: the step is never shortened to meet it."""
    frames: bool = True
    """Write frames to ``run.vtkhdf`` (also needed for the pictures)."""
    fields: tuple[str, ...] = DEFAULT_FIELDS
    """Fields in a frame, besides ``position`` and ``id``; with the default also what a model shows of itself.

    The shifting ``optimised`` shows its ``surface_class``, the step weakly-compressible its ``relative_density``.
    """
    log_interval: Annotated[int, Field(ge=1)] = 1
    """Steps between two lines of ``log.csv`` [1]."""
    pictures: bool = True
    """Draw ``snapshot.png`` and a picture of every gauge at the end."""
    checkpoint_interval: Annotated[float, Field(ge=0.0)] | Literal["none"] = 600.0
    """Largest wall time between two checkpoints [s], from which ``spume run --resume`` continues; ``none`` writes none.
    Early in a run they come sooner, after a quarter of the time that it took so far (at least 5 s). The interval grows
    where writing takes more than a twentieth of it. One is also written at the start, when the run is interrupted,
    and at the end."""
    animation: Literal["auto", "gif", "mp4", "none"] = "auto"
    """Format of the animation; ``auto``: ``mp4`` where ffmpeg is installed, else ``gif``."""
    colour: str = "speed"
    """Field that colours the pictures: ``speed`` or a scalar field of the frames."""
    colour_range: tuple[float, float] | None = None
    """Values at the ends of the colour scale [SI unit of the field]; default: from the frames."""
    map: MapName | None = None
    """Colour map; default: one that suits the field."""
    view_deg: tuple[float, float] = (-60.0, 18.0)
    """3D: azimuth and height of the camera [degrees]."""

    def of_frame(self, known: Mapping[str, FieldLike]) -> tuple[str, ...]:
        """Return the names of the fields in a frame, of those that a run has: the chosen ones, or all shown ones."""
        if self.fields != DEFAULT_FIELDS:
            return self.fields
        shown = [name for name, field in known.items() if field.output and name not in ("position", "id")]
        return tuple(dict.fromkeys((*self.fields, *shown)))


class SimulationLike(Protocol):
    """What outputs use of a simulation."""

    time: float
    step_index: int
    dt: float
    statistics: dict[str, float | int]
    stage_times: dict[str, float]

    def snapshot(self) -> Snapshot:
        """Return the present state."""
        ...


class RunLike(Protocol):
    """What outputs use of a run.

    Attributes:
        simulation: the simulation, between two steps.
        case: the case (``title``, ``time.end``, ``gauge``, ``output``, ``reference``).
        folder: the run folder, which exists.
        status: ``running``, and at the end ``finished``, ``interrupted`` or ``failed``.
        device, threads, precision: what the kernels run on.
        hurried: whether to draw no pictures.
    """

    simulation: Any
    case: Any
    folder: Path
    status: str
    device: str
    threads: int
    precision: str
    hurried: bool


class Output:
    """Something that is told of a run's progress and writes; it never changes the state.

    The order is ``start`` (before the first step) or ``resume`` (in a run that is continued), ``after_step``
    (after each), ``finish`` (once, also after an error or an interruption: ``run.status`` tells).
    """

    def start(self, run: RunLike) -> None:
        """Look at the initial state."""

    def after_step(self, run: RunLike) -> None:
        """Look at the state after a step."""

    def finish(self, run: RunLike) -> None:
        """Write what is left, close files."""

    def state(self) -> dict[str, Any]:
        """Return what `resume` needs, as JSON takes it; what was written until now is on the disk then."""
        return {}

    def resume(self, run: RunLike, state: dict[str, Any]) -> None:
        """Begin, in place of `start`, where `state` was taken: what was written after that is dropped."""
        self.start(run)


class Outputs(Output):
    """All outputs of a run, one after the other, and the clock that keeps their time apart from the steps'.

    Attributes:
        step_times: wall time of every step of this process [s], without outputs.
        output_time: wall time that this process spent in outputs [s].
        started: monotonic time at the start [s].
        earlier: times of the processes that computed the run before this one continued it [s].
    """

    def __init__(self, outputs: Sequence[Output], checkpoint: Output | None = None) -> None:
        """Take the outputs in the order in which they are told, and the one that saves the state of all of them."""
        self.outputs = tuple(outputs)
        self.checkpoint = checkpoint
        self.step_times: list[float] = []
        self.output_time = 0.0
        self.started = time.perf_counter()
        self.earlier: dict[str, float] = {}
        self._left = self.started
        for output in (*self.outputs, checkpoint):
            if output is not None and hasattr(output, "clock"):
                output.clock = self

    def start(self, run: RunLike) -> None:
        self._tell(lambda output: output.start(run))

    def after_step(self, run: RunLike) -> None:
        self.step_times.append(time.perf_counter() - self._left)
        self._tell(lambda output: output.after_step(run))

    def finish(self, run: RunLike) -> None:
        """Finish every output, also where one fails or is interrupted; the first error is raised at the end."""
        entered = time.perf_counter()
        first: BaseException | None = None
        # The checkpoint first: what the others write at the end is no part of a run that goes on.
        for output in (*([] if self.checkpoint is None else [self.checkpoint]), *self.outputs):
            try:
                output.finish(run)
            except KeyboardInterrupt as error:  # what is left is quick without pictures, and says how the run ended
                first = first or error
                run.hurried = True
            except Exception as error:
                first = first or error
        self._leave(entered)
        if isinstance(first, OSError):
            raise _not_written(first) from first
        if first is not None:
            raise first

    def state(self) -> dict[str, Any]:
        parts = [output.state() for output in self.outputs]
        return {"times": self.times(), "outputs": {_name(o): s for o, s in zip(self.outputs, parts, strict=True)}}

    def resume(self, run: RunLike, state: dict[str, Any]) -> None:
        self.earlier = dict(state["times"])
        self._tell(lambda output: output.resume(run, state["outputs"].get(_name(output), {})))

    def times(self) -> dict[str, float]:
        """Return the wall times [s] of the run so far: ``wall``, ``steps``, ``compilation``, ``outputs``."""
        steps = np.array(self.step_times, dtype=float)
        compilation = 0.0
        if len(steps) > 2 * _COMPILING:
            usual = float(np.median(steps[_COMPILING:]))
            compilation = float(np.sum(np.maximum(steps[:_COMPILING] - usual, 0.0)))
        mine = {
            "wall": time.perf_counter() - self.started,
            "steps": float(steps.sum()) - compilation,
            "compilation": compilation,
            "outputs": self.output_time,
        }
        return {name: value + self.earlier.get(name, 0.0) for name, value in mine.items()}

    def _tell(self, say: Callable[[Output], None]) -> None:
        entered = time.perf_counter()
        try:
            for output in self.outputs:
                say(output)
            if self.checkpoint is not None:
                say(self.checkpoint)  # after the others, whose state it saves
        except OSError as error:
            raise _not_written(error) from error
        self._leave(entered)

    def _leave(self, entered: float) -> None:
        self._left = time.perf_counter()
        self.output_time += self._left - entered


_COMPILING = 3  # steps of a process that may compile kernels


def _not_written(error: OSError) -> NotWritten:
    return error if isinstance(error, NotWritten) else NotWritten(f"results cannot be written: {error}")


def _name(output: Output) -> str:
    return type(output).__name__.lower()
