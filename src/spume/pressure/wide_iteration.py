"""The multigrid iteration with a thread for each row: one graph of loops, which the device repeats by itself.

The program of a cycle is written out, each operation on a level a loop of its own over its rows (see `spume.lanes`);
what is solved directly is one task of one thread.
"""

from collections.abc import Callable, Sequence
from typing import Any

from spume import kernels, lanes
from spume.pressure.aggregation import level_type
from spume.pressure.cycle import (
    CORRECT,
    FIRST,
    ITERATIONS,
    POLISH,
    REST,
    RESTRICT,
    RIGHT,
    RUN,
    SOLVE,
    cycle_stages,
    outer_stages,
    run_function,
)
from spume.pressure.entries import SINGLES, Entries

_TOGETHER = 128
"""Threads that a device starts together."""

Task = tuple[int, int]
"""Operation and level; that of RUN is the number of the run."""


def tasks_of(
    program: Sequence[tuple[int, int]], spread_out: Callable[[int], bool]
) -> tuple[tuple[Task, ...], list[int]]:
    """Return the tasks of a program, and where in it the runs of one thread begin and end, one after another.

    Args:
        program: operations and levels (see ``cycle.program``).
        spread_out: whether many threads work on a level.
    """
    tasks: list[Task] = []
    runs: list[int] = []
    for index, (operation, level) in enumerate(program):
        if spread_out(level):
            # What cannot be solved directly are rows that stand alone: they are swept.
            tasks.append((POLISH if operation == SOLVE else operation, level))
        elif tasks and tasks[-1][0] == RUN:
            runs[-1] = index + 1
        else:
            tasks.append((RUN, len(runs) // 2))
            runs += [index, index + 1]
    return tuple(tasks), runs


@kernels.cached
def start_kernel(symmetric: bool, entries: Entries) -> Any:
    """Return the kernel that computes the first residual and says whether there is anything to iterate."""
    qd, real, i32 = kernels.qd, kernels.runtime().real, kernels.i32
    Level, Reals = level_type(entries), kernels.array_type(real)
    Flag = qd.types.ndarray(dtype=i32, ndim=0)
    o, fold, every = outer_stages(symmetric, entries), lanes.fold().fold, lanes.parts_of().every

    @kernels.kernel
    def start(
        level: Level, diagonal: Reals, x: Reals, rhs: Reals, r: Reals, p: Reals, q: Reals, partial: Reals,  # type: ignore[valid-type]
        scalars: Reals, running: Flag, tolerance: real, floor: real, loosest: real, n: i32, parts: i32,  # type: ignore[valid-type]
    ):  # fmt: skip
        qd.loop_config(block_dim=_TOGETHER)
        for b in range(every(parts, n)):
            o.residual(b, every(parts, n), level, diagonal, x, rhs, r, p, q, partial, floor, loosest, n)
        fold(partial, n)
        qd.loop_config(serialize=True)
        for _ in range(1):
            o.begin(parts, partial, scalars)
            running[None] = qd.cast(scalars[REST] > tolerance * tolerance * scalars[RIGHT], i32)

    return start


@kernels.cached
def iterate_kernel(symmetric: bool, entries: Entries, tasks: tuple[Task, ...], levels: int) -> Any:
    """Generate the kernel that iterates until the residual is small enough.

    Args:
        symmetric, entries: as in `cycle_stages`.
        tasks: those that solve on level 1 (see `tasks_of`).
        levels: coarse levels whose first row and number of rows are arguments: those that many threads work on, and
            one more.
    """
    qd = kernels.qd
    Reals, Rows = kernels.array_type(kernels.runtime().real), kernels.array_type(kernels.i32)
    scope: dict[str, Any] = {
        "Level": level_type(entries), "Coarse": level_type(SINGLES), "Reals": Reals, "Rows": Rows,
        "Flag": qd.types.ndarray(dtype=kernels.i32, ndim=0), "real": kernels.runtime().real,
        "f": cycle_stages(symmetric, entries), "c": cycle_stages(symmetric, SINGLES),
        "o": outer_stages(symmetric, entries), "fold": lanes.fold().fold, "total": lanes.fold().total,
        "run": run_function(symmetric), "every": lanes.parts_of().every, "together": _TOGETHER,
    }  # fmt: skip
    body: list[str] = []

    def each(n: str, call: str) -> None:
        body.extend(
            [
                "qd.loop_config(block_dim=together)",
                f"for b in range(every(parts, {n})):",
                f"    {call.replace('PART', f'b, every(parts, {n})')}",
            ]
        )

    def once(*lines: str) -> None:
        body.extend(["qd.loop_config(serialize=True)", "for _ in range(1):", *[f"    {line}" for line in lines]])

    def work(operation: int, k: int) -> None:
        at, n = f"at{k}", f"n{k}"
        if operation == RUN:
            once(f"run(operations, begin{k}, end{k}, coarse, table, partial, scalars)")
        elif operation == RESTRICT:
            each(n, f"c.leave(PART, coarse, {at}, {n})")
            each(f"n{k + 1}", f"c.restrict(PART, coarse, {at}, coarse, at{k + 1}, n{k + 1})")
        elif operation == CORRECT:
            each(n, f"c.correct(PART, coarse, {at}, {n}, coarse, at{k + 1})")
        elif operation == POLISH:
            each(n, f"c.polish(PART, coarse, {at}, {n})")
        else:
            which = "first" if operation == FIRST else "second"
            each(n, f"c.{which}_products(PART, coarse, {at}, {n}, partial)")
            body.append(f"fold(partial, {n})")
            once(f"c.{which}_scalars(parts, {k}, partial, scalars)")
            each(n, f"c.{which}_step(PART, coarse, {at}, {n}, {k}, {'partial, ' if operation == FIRST else ''}scalars)")

    if tasks:
        each("n", "f.leave(PART, level, 0, n)")
        each("n1", "f.restrict(PART, level, 0, coarse, 0, n1)")
        for task in tasks:
            work(*task)
        each("n", "f.correct(PART, level, 0, n, coarse, 0)")
    each("n", "f.polish(PART, level, 0, n)")
    each("n", "o.products(PART, level, diagonal, r, q, image, partial, n)")
    body.append("fold(partial, n)")
    once("o.decide(parts, partial, scalars)")
    each("n", "o.advance(PART, level, x, r, p, q, image, partial, scalars, n)")
    body.append("fold(partial, n)")
    once(
        "rest = total(partial, parts, 0)",
        f"scalars[{REST}] = rest",
        # Written so that a residual that is not a number ends the iteration.
        f"running[None] = qd.cast((rest > tolerance * tolerance * scalars[{RIGHT}])"
        f" & (scalars[{ITERATIONS}] < largest), qd.i32)",
    )
    numbers = [f"{name}{k}: qd.i32" for k in range(1, levels + 1) for name in ("at", "n")]
    numbers += [f"{name}{k}: qd.i32" for operation, k in tasks if operation == RUN for name in ("begin", "end")]
    lines = [
        "def iterate(",
        "    level: Level, coarse: Coarse, table: Rows, operations: Rows, diagonal: Reals, x: Reals, r: Reals,",
        "    p: Reals, q: Reals, image: Reals, partial: Reals, scalars: Reals, running: Flag, tolerance: real,",
        f"    largest: qd.i32, parts: qd.i32, n: qd.i32, {', '.join(numbers)}):",
        "    while qd.graph.do_while(running):",
        *[f"        {line}" for line in body],
    ]
    return kernels.compiled("iterate", "\n".join(lines) + "\n", graph=True, **scope)
