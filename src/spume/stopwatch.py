"""Wall time by stage, and what else is counted by stage."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class Stopwatch:
    """Adds up wall time by name: ``with stages("search"): ...``.

    Attributes:
        times: wall time [s] spent in each stage.
        meter: a counter that is read before and after each stage, for benchmarks.
        amounts: how much the meter went up in each stage.
        settle: what is waited for at a stage's end, for benchmarks: a device works on while the program goes on.
    """

    def __init__(self) -> None:
        self.times: dict[str, float] = {}
        self.meter: Callable[[], float] = float
        self.amounts: dict[str, float] = {}
        self.settle: Callable[[], None] = _nothing

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        """Add the wall time of a block to a stage, also of one that ends with an error."""
        before, begin = self.meter(), time.perf_counter()
        try:
            yield
            self.settle()
        finally:
            self.times[name] = self.times.get(name, 0.0) + time.perf_counter() - begin
            self.amounts[name] = self.amounts.get(name, 0.0) + self.meter() - before


def _nothing() -> None:
    pass
