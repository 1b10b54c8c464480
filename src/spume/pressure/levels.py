"""The kernel that builds the levels of the multigrid method in one thread."""

from typing import Any

from spume import kernels
from spume.pressure.aggregation import (
    DEPTH,
    LEVELS,
    OVERFLOW,
    SLOTS,
    TOO_FEW_ROWS,
    WRAPPED,
    level_type,
    particle_stages,
    scratch_type,
    stages,
)
from spume.pressure.coarsest import direct_stages
from spume.pressure.entries import SINGLES, Entries


@kernels.cached
def entering() -> Any:
    """Return the function that enters a new level into the table."""
    i32 = kernels.i32
    Rows = kernels.array_type(i32)

    @kernels.func
    def enter(table: Rows, k: i32, found: i32, rows: i32):  # type: ignore[no-untyped-def, valid-type]
        """Note the rows of level k + 1 in the table, or that there is no room for them."""
        to = table[2 * k] + table[2 * k + 1]
        if k == 0:
            to = 0
        table[2 * k + 2] = to
        table[2 * k + 3] = found
        if to + found > rows:
            table[OVERFLOW] |= TOO_FEW_ROWS
            table[2 * k + 3] = 0
        elif found > 0:
            table[DEPTH] = k + 2

    return enter


@kernels.cached
def coarsening(entries: Entries, finest: bool) -> Any:
    """Return the function that builds level k + 1 from level k in one thread."""
    i32 = kernels.i32
    Level, Coarse, Scratch = level_type(entries), level_type(SINGLES), scratch_type()
    Rows, Reals = kernels.array_type(i32), kernels.array_type(kernels.runtime().real)
    s, enter = stages(entries, finest), entering()

    @kernels.func
    def coarsen(
        level: Level, diagonal: Reals, coarse: Coarse, scratch: Scratch, table: Rows, k: i32, rows: i32, slots: i32,  # type: ignore[valid-type]
    ):  # fmt: skip
        """Build level k + 1 once the rows of level k are counted into cells."""
        at = table[2 * k]
        to = at + table[2 * k + 1]
        if k == 0:
            to = 0
        n = s.cells(table, k)
        s.scan(n, scratch.cursor, scratch.begin)
        s.scatter(0, 1, level, at, table[2 * k + 1], scratch)
        s.split(0, 1, level, at, n, kernels.qd.max(kernels.qd.min(k, 1), table[WRAPPED]), scratch)
        found = s.scan(n, scratch.cursor, scratch.base)
        enter(table, k, found, rows)
        if table[DEPTH] == k + 2:
            s.number(0, 1, level, at, coarse, to, n, scratch)
            used = table[SLOTS]
            table[SLOTS] = s.combine(0, 1, level, diagonal, at, coarse, to, found, used, slots - used, scratch, table)

    return coarsen


@kernels.cached
def coarser_levels() -> Any:
    """Return the function that builds all levels behind level k in one thread, down to one that is solved directly."""
    i32 = kernels.i32
    Coarse, Scratch = level_type(SINGLES), scratch_type()
    Rows, Reals = kernels.array_type(i32), kernels.array_type(kernels.runtime().real)
    s, coarsen, factorise = stages(SINGLES, False), coarsening(SINGLES, False), direct_stages().factorise

    @kernels.func
    def build_coarser(
        coarse: Coarse, diagonal: Reals, scratch: Scratch, table: Rows, first: i32, rows: i32, slots: i32,  # type: ignore[valid-type]
    ):  # fmt: skip
        k = first
        searching = 1
        while searching == 1 and table[DEPTH] == k + 1 and table[OVERFLOW] == 0 and k < LEVELS:
            if factorise(coarse, table, k) == 1:
                searching = 0
            else:
                s.zero(0, 1, scratch.cursor, s.cells(table, k), 0)
                s.place(0, 1, coarse, table[2 * k], table[2 * k + 1], k, scratch, table)
                coarsen(coarse, diagonal, coarse, scratch, table, k, rows, slots)
                k += 1

    return build_coarser


@kernels.cached
def build_in_one_thread(d: int, entries: Entries) -> Any:
    """Return the kernel that builds all levels in one go; ``table`` says how many, and what there was no room for."""
    qd, real = kernels.qd, kernels.runtime().real
    i32 = kernels.i32
    Level, Coarse, Scratch = level_type(entries), level_type(SINGLES), scratch_type()
    Rows, Reals, Vectors = (kernels.array_type(t) for t in (i32, real, kernels.vector(d)))
    s, p = stages(SINGLES, False), particle_stages(d, entries)
    first, build_coarser = coarsening(entries, True), coarser_levels()

    @kernels.kernel
    def build_levels(
        level: Level, diagonal: Reals, coarse: Coarse, scratch: Scratch, table: Rows, low: Vectors, high: Vectors,  # type: ignore[valid-type]
        position: Vectors, state: Rows, cell: real, count: i32, rows: i32, slots: i32, most: i32,  # type: ignore[valid-type]
    ):  # fmt: skip
        qd.loop_config(serialize=True)
        for _ in range(1):
            p.survey(0, 1, position, state, low, high, scratch.counts, count)
            p.grid(1, low, high, p.sum_counts(1, scratch.counts), table, cell, most)
            s.zero(0, 1, scratch.cursor, s.cells(table, 0), 0)
            p.place_particles(0, 1, level, diagonal, position, state, low, scratch.counts, scratch, table, cell, count)
            first(level, diagonal, coarse, scratch, table, 0, rows, slots)
            build_coarser(coarse, diagonal, scratch, table, 1, rows, slots)

    return build_levels
