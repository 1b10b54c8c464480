"""Where the threads of the kernel language's pool run.

Linux tends to wake all threads of a pool on the processor of the thread that wakes them, or on the one that they ran
on last: for some milliseconds, which is longer than most loops, they then share a processor while others are idle.
So every thread of the pool gets a group of processors of its own. As many groups as threads, of all processors that
the process may use: other processes find room within the same groups.
"""

import contextlib
import os
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

_TASKS = Path("/proc/self/task")
_TOPOLOGY = Path("/sys/devices/system/cpu")


def threads_of_process() -> frozenset[int]:
    """Return the system's numbers of all threads of this process; none where they cannot be told."""
    with contextlib.suppress(OSError):
        return frozenset(int(task.name) for task in _TASKS.iterdir())
    return frozenset()


def settle(before: frozenset[int], threads: int) -> None:
    """Give each thread of a new pool processors of its own; where that cannot be done nothing happens.

    Args:
        before: threads of the process before the pool was made.
        threads: number of threads of the pool, the last ones that were made.
    """
    pool = sorted(threads_of_process() - before)[-threads:]
    if threads < 2 or len(pool) < threads or not hasattr(os, "sched_setaffinity"):
        return
    allowed = os.sched_getaffinity(0)
    for thread, mine in zip(pool, groups(by_core(allowed, _TOPOLOGY), threads), strict=True):
        with contextlib.suppress(OSError):
            os.sched_setaffinity(thread, mine)


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
            return (*(int((folder / name).read_text()) for name in ("physical_package_id", "core_id")), processor)  # type: ignore[return-value]
        except (OSError, ValueError):
            return (0, processor, processor)

    return sorted(processors, key=place)
