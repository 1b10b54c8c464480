"""The multigrid iteration with several threads of a processor: a team that is woken once a solve (see `spume.team`)."""

from collections.abc import Sequence
from typing import Any

from spume import kernels, team
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
    SECOND,
    SOLVE,
    cycle_stages,
    outer_stages,
)
from spume.pressure.entries import SINGLES, Entries

RESIDUAL, LEAVE, FIRST_STEP, SECOND_STEP, PRODUCTS, ADVANCE = range(10, 16)
"""Stages beside the operations of `cycle.program`. All on one level but RESTRICT are parts of that level's rows."""


def stages_of(program: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return the stages of an iteration, as (operation, level).

    Args:
        program: operations that solve on level 1 (see ``cycle.program``).
    """
    found: list[tuple[int, int]] = []
    for operation, level in [(RESTRICT, 0), *program, (CORRECT, 0)] if program else []:
        if operation == RESTRICT:
            found.append((LEAVE, level))
        found.append((operation, level))
        if operation in (FIRST, SECOND):
            found.append((FIRST_STEP if operation == FIRST else SECOND_STEP, level))
    return [*found, (POLISH, 0), (PRODUCTS, 0), (ADVANCE, 0)]


@kernels.cached
def solve_in_team(symmetric: bool, entries: Entries) -> Any:
    """Return the kernel that iterates in one go.

    Its stages: the residual, then those of an iteration (``stages_of``) again and again. What is decided once a stage
    is decided by whoever finishes it.
    """
    qd, real = kernels.qd, kernels.runtime().real
    i32 = kernels.i32
    Level, Coarse = level_type(entries), level_type(SINGLES)
    Reals, Rows, Board = kernels.array_type(real), kernels.array_type(i32), team.board_type()
    f, c, o = cycle_stages(symmetric, entries), cycle_stages(symmetric, SINGLES), outer_stages(symmetric, entries)
    together, solve_directly = team.calls(), direct_stages().solve
    threads, end = kernels.runtime().threads, team.END
    spread = kernels.spread(threads)

    @kernels.func
    def coarse_part(
        operation: i32, b: i32, parts: i32, k: i32, coarse: Coarse, table: Rows, partial: Reals, scalars: Reals
    ):
        """Work on part b of a coarse level."""
        at = table[2 * k]
        n = table[2 * k + 1]
        if operation == LEAVE:
            c.leave(b, parts, coarse, at, n)
        elif operation == RESTRICT:
            c.restrict(b, parts, coarse, at, coarse, at + n, table[2 * k + 3])
        elif operation == CORRECT:
            c.correct(b, parts, coarse, at, n, coarse, at + n)
        elif operation == FIRST:
            c.first_products(b, parts, coarse, at, n, partial)
        elif operation == FIRST_STEP:
            c.first_step(b, parts, coarse, at, n, k, partial, scalars)
        elif operation == SECOND:
            c.second_products(b, parts, coarse, at, n, partial)
        elif operation == SECOND_STEP:
            c.second_step(b, parts, coarse, at, n, k, scalars)
        elif operation == SOLVE and table[BAND] >= 0:
            solve_directly(coarse, at, n, table[BAND])
        else:
            # What cannot be solved directly are rows that stand alone, for which the sweep is exact, or nearly so.
            c.polish(b, parts, coarse, at, n)

    @kernels.func
    def operation_of(at: i32, stages: Rows, length: i32):
        return stages[2 * ((at - 1) % length)]

    @kernels.func
    def level_of(at: i32, stages: Rows, length: i32):
        return stages[2 * ((at - 1) % length) + 1]

    @kernels.func
    def parts_of(operation: i32, k: i32, table: Rows):
        n = table[2 * k + 1]
        if operation == RESTRICT:
            n = table[2 * k + 3]
        parts = together.parts(n)
        if operation == SOLVE:
            parts = 1
        return parts

    @kernels.kernel
    def solve_by_team(
        level: Level, coarse: Coarse, table: Rows, stages: Rows, length: i32, diagonal: Reals, x: Reals,
        rhs: Reals, r: Reals, p: Reals, q: Reals, image: Reals, partial: Reals, scalars: Reals, board: Board,
        tolerance: real, floor: real, loosest: real, largest: i32,
    ):  # fmt: skip
        qd.loop_config(serialize=True)
        for _ in range(1):
            together.gather(board)
        for t in range(threads * spread):
            at = 0 if t % spread == 0 else end
            n = table[1]
            while at < end:
                taken = together.take(board)
                at = together.stage(taken)
                b = together.part(taken)
                if at < end:
                    operation = RESIDUAL
                    k = 0
                    if at > 0:
                        operation = operation_of(at, stages, length)
                        k = level_of(at, stages, length)
                    parts = parts_of(operation, k, table)
                    if b >= parts:
                        together.wait(board, at)
                    else:
                        if k > 0:
                            coarse_part(operation, b, parts, k, coarse, table, partial, scalars)
                        elif operation == LEAVE:
                            f.leave(b, parts, level, 0, n)
                        elif operation == RESTRICT:
                            f.restrict(b, parts, level, 0, coarse, 0, table[3])
                        elif operation == CORRECT:
                            f.correct(b, parts, level, 0, n, coarse, 0)
                        elif operation == POLISH:
                            f.polish(b, parts, level, 0, n)
                        elif operation == PRODUCTS:
                            o.products(b, parts, level, diagonal, r, q, image, partial, n)
                        elif operation == ADVANCE:
                            o.advance(b, parts, level, x, r, p, q, image, partial, scalars, n)
                        else:
                            o.residual(b, parts, level, diagonal, x, rhs, r, p, q, partial, floor, loosest, n)
                        if together.last(board, parts) == 1:
                            then = at + 1
                            if operation == FIRST:
                                c.first_scalars(parts, k, partial, scalars)
                            elif operation == FIRST_STEP:
                                if c.enough(parts, k, partial, scalars):
                                    while (
                                        operation_of(then, stages, length) != SECOND_STEP
                                        or level_of(then, stages, length) != k
                                    ):
                                        then += 1
                            elif operation == SECOND:
                                c.second_scalars(parts, k, partial, scalars)
                            elif operation == PRODUCTS:
                                o.decide(parts, partial, scalars)
                            elif operation == RESIDUAL or operation == ADVANCE:  # noqa: SIM109
                                if operation == RESIDUAL:
                                    o.begin(parts, partial, scalars)
                                else:
                                    scalars[REST] = o.total(partial, parts, 0)
                                # Written so that a residual that is not a number ends the iteration.
                                going_on = scalars[REST] > tolerance * tolerance * scalars[RIGHT]
                                if not (going_on and scalars[ITERATIONS] < largest):
                                    then = end
                            together.open(board, then)

    return solve_by_team
