"""What an output is, and the settings of a case's ``[output]`` table."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Protocol

from pydantic import Field

from spume.named import Parameters
from spume.outputs.snapshot import Snapshot
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
    """Fields in a frame, besides ``position`` and ``id``."""
    log_interval: Annotated[int, Field(ge=1)] = 1
    """Steps between two lines of ``log.csv``."""
    pictures: bool = True
    """Draw ``snapshot.png`` and a picture of every gauge at the end."""
    animation: Literal["auto", "gif", "mp4", "none"] = "auto"
    """Format of the animation; ``auto``: ``mp4`` where ffmpeg is installed, else ``gif``."""
    colour: str = "speed"
    """Field that colours the pictures: ``speed`` or a scalar field of the frames."""
    colour_range: tuple[float, float] | None = None
    """Values at the ends of the colour scale; default: from the frames."""
    map: MapName | None = None
    """Colour map; default: one that suits the field."""
    view_deg: tuple[float, float] = (-60.0, 18.0)
    """3D: azimuth and height of the camera [degrees]."""


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
        case_folder: where the files that the case names are; None for a case without files.
        status: ``running``, and at the end ``finished``, ``interrupted`` or ``failed``.
        device, threads, precision: what the kernels run on.
    """

    simulation: Any
    case: Any
    folder: Path
    case_folder: Path | None
    status: str
    device: str
    threads: int
    precision: str


class Output:
    """Something that is told of a run's progress and writes; it never changes the state.

    The order is ``start`` (before the first step), ``after_step`` (after each), ``finish`` (once,
    also after an error or an interruption: ``run.status`` tells).
    """

    def start(self, run: RunLike) -> None:
        """Look at the initial state."""

    def after_step(self, run: RunLike) -> None:
        """Look at the state after a step."""

    def finish(self, run: RunLike) -> None:
        """Write what is left, close files."""


class Outputs(Output):
    """All outputs of a run, one after the other, and the clock that keeps their time apart from the steps'.

    Attributes:
        step_times: wall time of every step [s], without outputs.
        output_time: wall time spent in outputs [s].
        started: monotonic time at the start [s].
    """

    def __init__(self, outputs: Sequence[Output]) -> None:
        self.outputs = tuple(outputs)
        self.step_times: list[float] = []
        self.output_time = 0.0
        self.started = time.perf_counter()
        self._left = self.started
        for output in self.outputs:
            if hasattr(output, "clock"):
                output.clock = self

    def start(self, run: RunLike) -> None:
        entered = time.perf_counter()
        for output in self.outputs:
            output.start(run)
        self._leave(entered)

    def after_step(self, run: RunLike) -> None:
        entered = time.perf_counter()
        self.step_times.append(entered - self._left)
        for output in self.outputs:
            output.after_step(run)
        self._leave(entered)

    def finish(self, run: RunLike) -> None:
        """Finish every output, also where one fails; the first error is raised at the end."""
        entered = time.perf_counter()
        first: Exception | None = None
        for output in self.outputs:
            try:
                output.finish(run)
            except Exception as error:
                first = first or error
        self._leave(entered)
        if first is not None:
            raise first

    def _leave(self, entered: float) -> None:
        self._left = time.perf_counter()
        self.output_time += self._left - entered
