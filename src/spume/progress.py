"""How far a run is, in a terminal."""

from __future__ import annotations

import re
import time as wall
from collections import deque
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console


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


_UNITS = {"s": 1.0, "min": 60.0, "m": 60.0, "h": 3600.0, "d": 86400.0}


def seconds_of(text: str) -> float:
    """Return a wall time [s] that is written ``01:30:00`` (hours, minutes, seconds), ``2-12:00:00`` (days before
    them), ``90:00`` (minutes, seconds), or as a number with a unit: ``5400s``, ``90min``, ``1.5h``, ``2d``.

    Raises:
        ValueError: anything else; a bare number is minutes to some and seconds to others.
    """
    clock = re.fullmatch(r"(?:(\d+)-)?(?:(\d+):)?(\d+):(\d\d)", text.strip())
    number = re.fullmatch(r"(\d+(?:\.\d*)?|\.\d+)\s*(s|min|m|h|d)", text.strip())
    seconds = 0.0
    if clock and (clock[1] is None or clock[2] is not None):
        days, hours, minutes, rest = (int(part or 0) for part in clock.groups())
        seconds = float(86400 * days + 3600 * hours + 60 * minutes + rest)
    elif number:
        seconds = float(number[1]) * _UNITS[number[2]]
    if seconds <= 0.0:
        raise ValueError(f"{text!r}: must be a time as 01:30:00, 90min, 5400s, 1.5h or 2-12:00:00")
    return seconds
