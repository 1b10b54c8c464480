"""Where the threads of the kernel language's pool run.

Linux tends to wake all threads of a pool on the processor of the thread that wakes them, or on the one that they ran
on last: for some milliseconds, which is longer than most loops, they then share a processor while others are idle.
So every thread of the pool gets a group of processors of its own. As many groups as threads, of all processors that
the process may use: other processes find room within the same groups.

Where they find none, threads that keep to their processors are the wrong answer: two runs of two threads on two
processors get on better with a processor each. The system says how long threads waited for a processor, and where
that is long, they are let go for a while.
"""

import contextlib
import os
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

_TASKS = Path("/proc/self/task")
_TOPOLOGY = Path("/sys/devices/system/cpu")

_LOOK, _APART = 1.0, 20.0
"""Seconds from one look at the threads to the next, and for which they are let go."""
_CROWDED = 0.25
"""Part of the time that threads want to run and wait, from which on they are let go."""
_TELLING = 1e8
"""Nanoseconds that they must have wanted to run for that part to mean anything."""


def threads_of_process() -> frozenset[int]:
    """Return the system's numbers of all threads of this process; none where they cannot be told."""
    with contextlib.suppress(OSError):
        return frozenset(int(task.name) for task in _TASKS.iterdir())
    return frozenset()


class Pool:
    """The threads of a pool, each on processors of its own as long as others leave these to it.

    Attributes:
        threads: the system's numbers of the threads; empty where their place cannot be chosen.
        settled: whether each has processors of its own now.
    """

    def __init__(self, before: frozenset[int], threads: int) -> None:
        """Settle the threads of a pool that was just made.

        Args:
            before: threads of the process before that.
            threads: number of threads of the pool, the last ones that were made.
        """
        made = sorted(threads_of_process() - before)[-threads:]
        possible = threads > 1 and len(made) == threads and hasattr(os, "sched_setaffinity")
        self.threads = tuple(made) if possible else ()
        self.settled = False
        self._next = 0.0
        self._before = (0, 0)
        if self.threads:
            self._settle()

    def review(self, now: float) -> None:
        """Let the threads go where they wait for others, and settle them again later; to be called once a step.

        Args:
            now: a time [s] that never goes back.
        """
        if not self.threads or now < self._next:
            return
        first = self._next == 0.0
        times = times_of(self.threads)
        ran, waited = (new - old for new, old in zip(times, self._before, strict=True))
        self._before, self._next = times, now + _LOOK
        if first:
            return
        if not self.settled:
            self._settle()
        elif ran + waited > _TELLING and waited > _CROWDED * (ran + waited):
            self._place([sorted(os.sched_getaffinity(0))] * len(self.threads))
            self.settled, self._next = False, now + _APART

    def _settle(self) -> None:
        self._place(groups(by_core(os.sched_getaffinity(0), _TOPOLOGY), len(self.threads)))
        self.settled = True

    def _place(self, places: Sequence[Sequence[int]]) -> None:
        for thread, place in zip(self.threads, places, strict=True):
            with contextlib.suppress(OSError):
                os.sched_setaffinity(thread, place)


def times_of(threads: Sequence[int]) -> tuple[int, int]:
    """Return for how long threads of this process ran, and waited for a processor [ns]; zeros where nobody counts."""
    ran = waited = 0
    for thread in threads:
        with contextlib.suppress(OSError, ValueError):
            ran_now, waited_now, _ = map(int, (_TASKS / str(thread) / "schedstat").read_text().split())
            ran, waited = ran + ran_now, waited + waited_now
    return ran, waited


def groups(processors: Sequence[int], number: int) -> list[list[int]]:
    """Return that many groups of neighbouring processors, of sizes as equal as can be.

    Groups overlap where there are more of them than processors.

    >>> groups([0, 4, 1, 5], 2), groups([0, 1], 3)
    ([[0, 4], [1, 5]], [[0], [0], [1]])
    """
    have = len(processors)
    bounds = [have * k // number for k in range(number + 1)]
    return [list(processors[first : max(last, first + 1)]) for first, last in pairwise(bounds)]


def by_core(processors: set[int], topology: Path) -> list[int]:
    """Return the processors so that those that are one core, and those that share a socket, stand beside each other.

    Args:
        topology: folder of the system's description, /sys/devices/system/cpu.
    """

    def place(processor: int) -> tuple[int, int, int]:
        folder = topology / f"cpu{processor}" / "topology"
        try:
            socket, core = (int((folder / name).read_text()) for name in ("physical_package_id", "core_id"))
        except (OSError, ValueError):
            socket, core = 0, processor
        return socket, core, processor

    return sorted(processors, key=place)
