"""The kernel that builds the levels of the multigrid method with a team of threads (see `spume.team`)."""

from typing import Any

from spume import kernels, team
from spume.pressure.aggregation import (
    DEPTH,
    LEVELS,
    OVERFLOW,
    SLOTS,
    WRAPPED,
    level_type,
    particle_stages,
    scratch_type,
    stages,
)
from spume.pressure.coarsest import direct_stages
from spume.pressure.entries import SINGLES, Entries
from spume.pressure.levels import entering

_BEGIN, _ZERO, _PLACE, _SCATTER, _SPLIT, _NUMBER, _COMBINE = range(7)
_STAGES = 7
"""Stages of a level. The first surveys the particles, or eliminates a coarse level where that is cheap."""


@kernels.cached
def build_in_team(d: int, entries: Entries) -> Any:
    """Return the kernel that builds all levels; ``table`` says how many, and what there was no room for."""
    qd, real = kernels.qd, kernels.runtime().real
    i32 = kernels.i32
    Level, Coarse, Scratch = level_type(entries), level_type(SINGLES), scratch_type()
    Rows, Reals, Vectors = (kernels.array_type(t) for t in (i32, real, kernels.vector(d)))
    Board, together = team.board_type(), team.calls()
    f, s, p = stages(entries, True), stages(SINGLES, False), particle_stages(d, entries)
    enter, factorise = entering(), direct_stages().factorise
    threads, end = kernels.runtime().threads, team.END
    spread = kernels.spread(threads)

    @kernels.func
    def room(table: Rows, slots: i32):
        """Return the slots that the next level may spread over."""
        return (slots - table[SLOTS]) // 5 * 4

    @kernels.func
    def parts_of(step: i32, k: i32, table: Rows, count: i32, most: i32):
        """Return how many parts a stage of level k has."""
        parts = 1
        if k == 0 and (step == _BEGIN or step == _PLACE):  # noqa: SIM109
            parts = together.parts(count)
        elif step == _ZERO or step == _SPLIT or step == _NUMBER:  # noqa: SIM109
            parts = together.parts(s.cells(table, k))
        elif step == _PLACE or step == _SCATTER:  # noqa: SIM109
            parts = together.parts(table[2 * k + 1])
        elif step == _COMBINE:
            parts = qd.min(together.parts(table[2 * k + 1]), most)
        return parts

    @kernels.func
    def coarse_part(
        step: i32, b: i32, parts: i32, k: i32, coarse: Coarse, diagonal: Reals, scratch: Scratch, table: Rows,
        slots: i32,
    ):  # fmt: skip
        """Work on part b of a coarse level."""
        at = table[2 * k]
        n = table[2 * k + 1]
        if step == _PLACE:
            s.place(b, parts, coarse, at, n, k, scratch, table)
        elif step == _SCATTER:
            s.scatter(b, parts, coarse, at, n, scratch)
        elif step == _SPLIT:
            s.split(b, parts, coarse, at, s.cells(table, k), 1, scratch)
        elif step == _NUMBER:
            s.number(b, parts, coarse, at, coarse, at + n, s.cells(table, k), scratch)
        else:
            s.combine(
                b, parts, coarse, diagonal, at, coarse, at + n, table[2 * k + 3], table[SLOTS], room(table, slots),
                scratch, table,
            )  # fmt: skip

    @kernels.kernel
    def build_by_team(
        level: Level, diagonal: Reals, coarse: Coarse, scratch: Scratch, table: Rows, low: Vectors, high: Vectors,
        position: Vectors, state: Rows, cell: real, count: i32, rows: i32, slots: i32, most: i32, combined: i32,
        board: Board,
    ):  # fmt: skip
        qd.loop_config(serialize=True)
        for _ in range(1):
            together.gather(board)
        for t in range(threads * spread):
            at = 0 if t % spread == 0 else end
            while at < end:
                taken = together.take(board)
                at = together.stage(taken)
                b = together.part(taken)
                if at < end:
                    k = at // _STAGES
                    step = at % _STAGES
                    parts = parts_of(step, k, table, count, combined)
                    if b >= parts:
                        together.wait(board, at)
                    else:
                        eliminated = 0
                        if step == _ZERO:
                            s.zero(b, parts, scratch.cursor, s.cells(table, k), 0)
                        elif step == _BEGIN:
                            if k == 0:
                                p.survey(b, parts, position, state, low, high, scratch.counts, count)
                            else:
                                eliminated = factorise(coarse, table, k)
                        elif k > 0:
                            coarse_part(step, b, parts, k, coarse, diagonal, scratch, table, slots)
                        elif step == _PLACE:
                            p.place_particles(
                                b, parts, level, diagonal, position, state, low, scratch.counts, scratch, table, cell,
                                count,
                            )  # fmt: skip
                        elif step == _SCATTER:
                            f.scatter(b, parts, level, 0, table[1], scratch)
                        elif step == _SPLIT:
                            f.split(b, parts, level, 0, s.cells(table, 0), table[WRAPPED], scratch)
                        elif step == _NUMBER:
                            f.number(b, parts, level, 0, coarse, 0, s.cells(table, 0), scratch)
                        else:
                            f.combine(
                                b, parts, level, diagonal, 0, coarse, 0, table[3], 0, room(table, slots), scratch,
                                table,
                            )  # fmt: skip
                        if together.last(board, parts) == 1:
                            then = at + 1
                            if step == _BEGIN:
                                if k == 0:
                                    p.grid(parts, low, high, p.sum_counts(parts, scratch.counts), table, cell, most)
                                elif eliminated == 1:
                                    then = end
                            elif step == _PLACE:
                                s.scan(s.cells(table, k), scratch.cursor, scratch.begin)
                            elif step == _SPLIT:
                                enter(table, k, s.scan(s.cells(table, k), scratch.cursor, scratch.base), rows)
                            elif step == _COMBINE:
                                table[SLOTS] += room(table, slots)
                            if (step == _SPLIT or step == _COMBINE) and (  # noqa: SIM109
                                table[OVERFLOW] != 0 or table[DEPTH] != k + 2 or k + 2 > LEVELS
                            ):
                                then = end
                            together.open(board, then)

    return build_by_team
