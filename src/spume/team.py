"""Threads of a processor that go through the stages of a computation together, within a single launch.

A launch hands a loop to the kernel language's pool of threads, which it wakes for every loop: 16 µs when the
processors are idle, and up to 0.1 ms beside other work. A team is woken once. Its stages are cut into parts; whoever
is free takes the next part of the stage at hand, and who finishes a stage's last part opens the next stage.

Nobody waits for a thread that has not begun a part, so that a team gets on, and ends, when fewer processors are free
than it has threads, or only one. What a part computes depends on its number, never on who computes it.
"""

from types import SimpleNamespace
from typing import Any

from spume import kernels

END = 1 << 30
"""Number of the stage after the last one."""

ROWS_OF_PART = 128
"""Rows of a part, at least: what is shared must take longer than the sharing, 0.2 to 1 µs."""

PARTS_OF_THREAD = 4
"""Parts for each thread, at most: more even shares than one each, when a thread is held up."""

_CLAIM, _DONE = 0, 16
"""Words of the board, in different cache lines: the stage (times 2³²) and the number of its parts taken; those done."""


def board() -> Any:
    """Return a new array on which a team notes how far it is."""
    return kernels.array(kernels.i64, 2 * _DONE)


def board_type() -> Any:
    """Return the type of a board, as an argument of kernels."""
    return kernels.array_type(kernels.i64)


def most_parts() -> int:
    """Return how many parts a stage has at most."""
    return PARTS_OF_THREAD * kernels.runtime().threads


@kernels.cached
def calls() -> Any:
    """Return the functions with which the threads of a team agree.

    * ``parts(n)``: how many parts n rows are worth;
    * ``gather(board)``: before the team sets out, in one thread;
    * ``take(board)``: take a part; returns its stage times 2³² plus its number, which may be beyond the last one's;
    * ``stage(taken)`` and ``part(taken)``: the two;
    * ``last(board, number)``: note that a part is done; returns 1 to who did the last one of that many, else 0;
    * ``open(board, stage)``: let the team go on to a stage of higher number, ``END`` to stop;
    * ``wait(board, stage)``: until the team is at another stage.

    These are atomic operations that order all that was written before them: what a stage wrote is seen by the next.
    Run on x86-64 only so far, where memory is strictly ordered anyway.
    """
    qd, i32, i64 = kernels.qd, kernels.i32, kernels.i64
    Board = board_type()
    claim, done, rows_of_part, most = _CLAIM, _DONE, ROWS_OF_PART, most_parts()

    @kernels.func
    def parts(n: i32):
        return qd.max(qd.min(n // rows_of_part, most), 1)

    @kernels.func
    def gather(board: Board):
        board[claim] = 0
        board[done] = 0

    @kernels.func
    def take(board: Board):
        return qd.atomic_add(board[claim], qd.cast(1, i64))

    @kernels.func
    def stage(taken: i64):
        return qd.cast(taken >> 32, i32)

    @kernels.func
    def part(taken: i64):
        return qd.cast(taken - ((taken >> 32) << 32), i32)

    @kernels.func
    def last(board: Board, number: i32):
        is_last = 0
        if qd.atomic_add(board[done], qd.cast(1, i64)) + 1 == number:
            qd.atomic_add(board[done], qd.cast(-number, i64))
            is_last = 1
        return is_last

    @kernels.func
    def open_stage(board: Board, stage: i32):
        qd.atomic_max(board[claim], qd.cast(stage, i64) << 32)

    @kernels.func
    def wait(board: Board, stage: i32):
        now = stage
        while now == stage:
            now = qd.cast(qd.atomic_add(board[claim], qd.cast(0, i64)) >> 32, i32)

    return SimpleNamespace(
        parts=parts, gather=gather, take=take, stage=stage, part=part, last=last, open=open_stage, wait=wait
    )
