"""The multigrid iteration on devices with thousands of threads: one graph of loops over rows, all levels alike.

The program of a cycle is written out, each operation a loop of its own, so that the device iterates by itself.
"""

from typing import Any

from spume import kernels, lanes
from spume.pressure.aggregation import BAND, level_type
from spume.pressure.coarsest import direct_stages
from spume.pressure.cycle import (
    CORRECT,
    FIRST,
    ITERATIONS,
    POLISH,
    REST,
    RESTRICT,
    RIGHT,
    SOLVE,
    cycle_stages,
    outer_stages,
)
from spume.pressure.entries import SINGLES, Entries


@kernels.cached
def start_on_device(symmetric: bool, entries: Entries) -> Any:
    """Return the kernel that computes the first residual and says whether there is anything to iterate."""
    qd, real, i32 = kernels.qd, kernels.runtime().real, kernels.i32
    Level, Reals = level_type(entries), kernels.array_type(real)
    Flag = qd.types.ndarray(dtype=i32, ndim=0)
    o, fold = outer_stages(symmetric, entries), lanes.fold().fold

    @kernels.kernel
    def start_on_device(
        level: Level, diagonal: Reals, x: Reals, rhs: Reals, r: Reals, p: Reals, q: Reals, partial: Reals,  # type: ignore[valid-type]
        scalars: Reals, running: Flag, tolerance: real, floor: real, loosest: real, n: i32,  # type: ignore[valid-type]
    ):  # fmt: skip
        for t in range(n):
            o.residual(t, n, level, diagonal, x, rhs, r, p, q, partial, floor, loosest, n)
        fold(partial, n)
        qd.loop_config(serialize=True)
        for _ in range(1):
            o.begin(0, partial, scalars)
            running[None] = qd.cast(scalars[REST] > tolerance * tolerance * scalars[RIGHT], i32)

    return start_on_device


@kernels.cached
def iterate_on_device(
    symmetric: bool, entries: Entries, operations: tuple[tuple[int, int], ...], depth: int, direct: bool
) -> Any:
    """Generate the kernel that iterates until the residual is small enough.

    Args:
        symmetric, entries: as in `cycle_stages`.
        operations: the program that solves on level 1 (see ``cycle.program``).
        depth: number of levels, the particles' included.
        direct: whether the last level is solved directly, else it is swept.
    """
    qd = kernels.qd
    Reals, Rows = kernels.array_type(kernels.runtime().real), kernels.array_type(kernels.i32)
    scope: dict[str, Any] = {
        "Level": level_type(entries), "Coarse": level_type(SINGLES), "Reals": Reals, "Rows": Rows,
        "Flag": qd.types.ndarray(dtype=kernels.i32, ndim=0), "real": kernels.runtime().real,
        "f": cycle_stages(symmetric, entries), "c": cycle_stages(symmetric, SINGLES),
        "o": outer_stages(symmetric, entries), "fold": lanes.fold().fold, "total": lanes.fold().total,
        "solve": direct_stages().solve,
    }  # fmt: skip
    body: list[str] = []

    def each(rows: str, call: str) -> None:
        body.extend([f"for t in range({rows}):", f"    {call}"])

    def once(*lines: str) -> None:
        body.extend(["qd.loop_config(serialize=True)", "for _ in range(1):", *[f"    {line}" for line in lines]])

    def operate(operation: int, k: int) -> None:
        at, n = f"at{k}", f"n{k}"
        own = f"t, {n}, coarse, {at}"
        if operation == RESTRICT:
            each(n, f"c.leave({own}, {n})")
            each(f"n{k + 1}", f"c.restrict(t, n{k + 1}, coarse, {at}, coarse, at{k + 1}, n{k + 1})")
        elif operation == CORRECT:
            each(n, f"c.correct({own}, {n}, coarse, at{k + 1})")
        elif operation == POLISH or (operation == SOLVE and not direct):
            each(n, f"c.polish({own}, {n})")
        elif operation == SOLVE:
            once(f"solve(coarse, {at}, {n}, table[{BAND}])")
        else:
            which = "first" if operation == FIRST else "second"
            each(n, f"c.{which}_products({own}, {n}, partial)")
            body.append(f"fold(partial, {n})")
            once(f"c.{which}_scalars(0, {k}, partial, scalars)")
            each(n, f"c.{which}_step({own}, {n}, {k}, scalars)")

    if depth > 1:
        each("n", "f.leave(t, n, level, 0, n)")
        each("n1", "f.restrict(t, n1, level, 0, coarse, 0, n1)")
        for operation, k in operations:
            operate(operation, k)
        each("n", "f.correct(t, n, level, 0, n, coarse, 0)")
    each("n", "f.polish(t, n, level, 0, n)")
    each("n", "o.products(t, n, level, diagonal, r, q, image, partial, n)")
    body.append("fold(partial, n)")
    once("o.decide(0, partial, scalars)")
    each("n", "o.advance(t, n, level, x, r, p, q, image, partial, scalars, n)")
    body.append("fold(partial, n)")
    once(
        "rest = total(partial, 0, 0)",
        f"scalars[{REST}] = rest",
        # Written so that a residual that is not a number ends the iteration.
        f"running[None] = qd.cast((rest > tolerance * tolerance * scalars[{RIGHT}])"
        f" & (scalars[{ITERATIONS}] < largest), qd.i32)",
    )
    levels = "".join(f", at{k}: qd.i32, n{k}: qd.i32" for k in range(1, depth))
    lines = [
        "def iterate_on_device(",
        "    level: Level, coarse: Coarse, table: Rows, diagonal: Reals, x: Reals, r: Reals, p: Reals, q: Reals,",
        "    image: Reals, partial: Reals, scalars: Reals, running: Flag, tolerance: real, largest: qd.i32,",
        f"    n: qd.i32{levels}):",
        "    while qd.graph.do_while(running):",
        *[f"        {line}" for line in body],
    ]
    return kernels.compiled("iterate_on_device", "\n".join(lines) + "\n", graph=True, **scope)
