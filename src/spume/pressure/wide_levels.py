"""Kernels that build the levels of the multigrid method on devices with thousands of threads, a row each."""

from itertools import product
from typing import Any

from spume import kernels, lanes
from spume.pressure.aggregation import (
    OVERFLOW,
    SLOTS,
    SURVEYED,
    TOO_FEW_SLOTS,
    WRAPPED,
    level_type,
    particle_stages,
    scratch_type,
    stages,
)
from spume.pressure.coarsest import direct_stages
from spume.pressure.entries import SINGLES, Entries, entry_functions
from spume.pressure.levels import entering

_BOUNDS = 128
"""Bounds of parts of the rows that are left to one thread."""


@kernels.cached
def combine_row(entries: Entries, finest: bool) -> Any:
    """Generate the function that sums the rows and columns of one aggregate (see `stages` for the arguments).

    The columns are nearly all aggregates of the cells around: their sums stay in registers, each entry is compared
    with all of them, and only what is left over looks for its column in memory, where the cache has no room for
    the columns of as many rows as there are threads. Entries are taken slot by slot, for the members of an
    aggregate tend to lie beside each other.
    """
    around = [o for o in product((-1, 0, 1), repeat=3) if any(o)]
    stride = lanes.stride()
    keys = []
    for n, (c, b, a) in enumerate(around):
        inside = [f"x{k} {'> 0' if o < 0 else f'< s{k} - 1'}" for k, o in enumerate((a, b, c)) if o]
        keys += [
            f"key{n} = -1",
            f"sum{n} = qd.cast(0, qd.f32)",
            f"if {' and '.join(inside)}:",
            f"    c = cell + {a} + s0 * ({b} + s1 * {c})",
            "    if scratch.base[c + 1] > scratch.base[c]:",
            f"        key{n} = scratch.base[c]",
        ]
    lines = [
        "def combine_row(",
        "    b: qd.i32, k: qd.i32, level: Level, diagonal: Reals, at: qd.i32, coarse: Coarse, to: qd.i32,",
        "    slots: qd.i32, room: qd.i32, scratch: Scratch, table: Rows):",
        "    row = to + b",
        f"    first = slots + b // {stride} * {stride} * room + b % {stride}",
        "    begin = coarse.first[row]",
        "    end = coarse.last[row]",
        "    cell = coarse.cell[row]",
        *[f"    s{axis} = shape(table, k, {axis})" for axis in range(3)],
        "    x0 = cell % s0",
        "    x1 = cell // s0 % s1",
        "    x2 = cell // (s0 * s1)",
        *[f"    {line}" for line in keys],
        "    used = 0",
        "    lacking = 0",
        "    longest = 0",
        "    excess = qd.cast(0, real)",
        "    size = qd.cast(0, real)",
        "    for s in range(begin, end):",
        "        i = at + level.member[at + s]",
        "        longest = qd.max(longest, level.length[i])",
        "        size += level.diagonal[i]",
        f"        excess += {'diagonal[i]' if finest else 'level.excess[i]'}",
        "    for q in range(longest):",
        "        for s in range(begin, end):",
        "            i = at + level.member[at + s]",
        "            if q < level.length[i]:",
        "                chunk = entry.chunk(level, i)",
        f"                slot = level.start[i] + q * {stride}",
        "                j = level.aggregate[at + entry.column(level, chunk, slot)]",
        "                v = entry.value(level, chunk, slot)",
        *(["                excess += v"] if finest else []),
        "                if j < 0:",
        # A row that is left to the sweeps counts as known.
        "                    excess -= v",
        "                elif j != b:",
        "                    w = qd.cast(v, qd.f32)",
        "                    near = 0",
        *[f"                    near += qd.cast(j == key{n}, qd.i32)" for n in range(len(around))],
        *[f"                    sum{n} += qd.select(j == key{n}, w, qd.cast(0, qd.f32))" for n in range(len(around))],
        "                    if near == 0:",
        "                        m = 0",
        "                        beyond = used",
        "                        while m < beyond:",
        f"                            if coarse.column[first + m * {stride}] == j:",
        "                                beyond = m",
        "                            else:",
        "                                m += 1",
        f"                        mine = first + m * {stride}",
        "                        if m < used:",
        "                            coarse.value[mine] = coarse.value[mine] + w",
        "                        elif used < room:",
        "                            coarse.column[mine] = j",
        "                            coarse.value[mine] = w",
        "                            used += 1",
        "                        else:",
        "                            lacking = 1",
        "    total = excess",
        "    for m in range(used):",
        f"        total -= coarse.value[first + m * {stride}]",
    ]
    for n in range(len(around)):
        lines += [
            f"    if sum{n} != 0:",
            f"        total -= sum{n}",
            "        if used < room:",
            f"            coarse.column[first + used * {stride}] = key{n}",
            f"            coarse.value[first + used * {stride}] = sum{n}",
            "            used += 1",
            "        else:",
            "            lacking = 1",
        ]
    lines += [
        "    if lacking == 1:",
        "        qd.atomic_or(table[overflow], too_few_slots)",
        "    finish(coarse, row, b, first, used, total, excess, size)",
    ]
    Level, s = level_type(entries), stages(entries, finest)
    return kernels.compiled_function(
        "combine_row", "\n".join(lines) + "\n", Level=Level, Coarse=level_type(SINGLES), Scratch=scratch_type(),
        Reals=kernels.array_type(kernels.runtime().real), Rows=kernels.array_type(kernels.i32),
        real=kernels.runtime().real, entry=entry_functions(Level, entries), shape=s.shape, finish=s.finish,
        overflow=OVERFLOW, too_few_slots=TOO_FEW_SLOTS,
    )  # fmt: skip


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
    combine_first, combine_next = combine_row(entries, True), combine_row(SINGLES, False)
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
            combine_first(b, 0, level, diagonal, 0, coarse, 0, 0, room, scratch, table)
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
            combine_next(
                b, k, coarse, diagonal, table[2 * k], coarse, table[2 * k + 2], table[SLOTS], room, scratch, table
            )
        qd.loop_config(serialize=True)
        for _ in range(1):
            take_slots(table, table[2 * k + 3], room)

    @kernels.kernel
    def eliminate(coarse: Coarse, table: Rows, k: i32):  # type: ignore[no-untyped-def, valid-type]
        qd.loop_config(serialize=True)
        for _ in range(1):
            factorise(coarse, table, k)

    return build_first, build_next, eliminate
