"""Kernels that build the levels of the multigrid method on devices with thousands of threads, a row each."""

from typing import Any

from spume import kernels, lanes
from spume.pressure.aggregation import (
    OVERFLOW,
    SLOTS,
    SURVEYED,
    WRAPPED,
    level_type,
    particle_stages,
    scratch_type,
    stages,
)
from spume.pressure.coarsest import direct_stages
from spume.pressure.entries import SINGLES, Entries
from spume.pressure.levels import entering

_BOUNDS = 128
"""Bounds of parts of the rows that are left to one thread."""


@kernels.cached
def build_on_device(d: int, entries: Entries) -> tuple[Any, Any, Any]:
    """Return the kernels that build the first level, build a further one, and eliminate the last.

    A coarse row has ``room`` slots; those of `lanes.GROUP` rows lie interleaved.
    """
    qd, real = kernels.qd, kernels.runtime().real
    i32 = kernels.i32
    Level, Coarse, Scratch = level_type(entries), level_type(SINGLES), scratch_type()
    Rows, Reals, Vectors = (kernels.array_type(t) for t in (i32, real, kernels.vector(d)))
    f, s, p = stages(entries, True), stages(SINGLES, False), particle_stages(d, entries)
    enter, factorise, scan = entering(), direct_stages().factorise, lanes.exclusive_sums()
    parts, bounds, group = SURVEYED, _BOUNDS, lanes.GROUP

    @kernels.func
    def take_slots(table: Rows, n: i32, room: i32):  # type: ignore[no-untyped-def, valid-type]
        table[SLOTS] += (n + group - 1) // group * group * room

    @kernels.kernel
    def build_first(
        level: Level, diagonal: Reals, coarse: Coarse, scratch: Scratch, table: Rows, low: Vectors, high: Vectors,  # type: ignore[valid-type]
        position: Vectors, state: Rows, cell: real, count: i32, rows: i32, room: i32, most: i32,  # type: ignore[valid-type]
    ):  # fmt: skip
        for b in range(parts):
            p.survey(b, parts, position, state, low, high, scratch.counts, count)
        for c in range(bounds):
            p.bring_together(c, bounds, parts, low, high)
        scan(scratch.counts, scratch.begin, scratch.sums, parts)
        qd.loop_config(serialize=True)
        for _ in range(1):
            p.grid(bounds, low, high, scratch.begin[parts], table, cell, most)
        for c in range(s.cells(table, 0)):
            scratch.cursor[c] = 0
        for b in range(parts):
            p.place_particles(
                b, parts, level, diagonal, position, state, low, scratch.counts, scratch, table, cell, count
            )
        scan(scratch.cursor, scratch.begin, scratch.sums, s.cells(table, 0))
        for t in range(table[1]):
            f.scatter(t, table[1], level, 0, table[1], scratch)
        for c in range(s.cells(table, 0)):
            f.split(c, s.cells(table, 0), level, 0, s.cells(table, 0), table[WRAPPED], scratch)
        scan(scratch.cursor, scratch.base, scratch.sums, s.cells(table, 0))
        qd.loop_config(serialize=True)
        for _ in range(1):
            enter(table, 0, scratch.base[s.cells(table, 0)], rows)
        for c in range(s.cells(table, 0)):
            if table[OVERFLOW] == 0:
                f.number(c, s.cells(table, 0), level, 0, coarse, 0, s.cells(table, 0), scratch)
        for b in range(table[3]):
            f.combine(b, table[3], level, diagonal, 0, coarse, 0, table[3], 0, room, scratch, table)
        qd.loop_config(serialize=True)
        for _ in range(1):
            take_slots(table, table[3], room)

    @kernels.kernel
    def build_next(
        coarse: Coarse, diagonal: Reals, scratch: Scratch, table: Rows, k: i32, rows: i32, room: i32,  # type: ignore[valid-type]
    ):  # fmt: skip
        for c in range(s.cells(table, k)):
            scratch.cursor[c] = 0
        for t in range(table[2 * k + 1]):
            s.place(t, table[2 * k + 1], coarse, table[2 * k], table[2 * k + 1], k, scratch, table)
        scan(scratch.cursor, scratch.begin, scratch.sums, s.cells(table, k))
        for t in range(table[2 * k + 1]):
            s.scatter(t, table[2 * k + 1], coarse, table[2 * k], table[2 * k + 1], scratch)
        for c in range(s.cells(table, k)):
            s.split(c, s.cells(table, k), coarse, table[2 * k], s.cells(table, k), 1, scratch)
        scan(scratch.cursor, scratch.base, scratch.sums, s.cells(table, k))
        qd.loop_config(serialize=True)
        for _ in range(1):
            enter(table, k, scratch.base[s.cells(table, k)], rows)
        for c in range(s.cells(table, k)):
            if table[OVERFLOW] == 0:
                s.number(
                    c, s.cells(table, k), coarse, table[2 * k], coarse, table[2 * k + 2], s.cells(table, k), scratch
                )
        for b in range(table[2 * k + 3]):
            s.combine(
                b, table[2 * k + 3], coarse, diagonal, table[2 * k], coarse, table[2 * k + 2], table[2 * k + 3],
                table[SLOTS], room, scratch, table,
            )  # fmt: skip
        qd.loop_config(serialize=True)
        for _ in range(1):
            take_slots(table, table[2 * k + 3], room)

    @kernels.kernel
    def eliminate(coarse: Coarse, table: Rows, k: i32):  # type: ignore[no-untyped-def, valid-type]
        qd.loop_config(serialize=True)
        for _ in range(1):
            factorise(coarse, table, k)

    return build_first, build_next, eliminate
