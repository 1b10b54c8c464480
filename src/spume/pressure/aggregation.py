"""Levels of the multigrid method: aggregates of rows in background cells, and Galerkin matrices of them.

Rows of the first coarse level are cells two particle spacings wide, cells of every further level are
twice as wide (bucket-based aggregation, Södersten, Matsunaga & Koshizuka 2019). Beyond the first level
an aggregate holds only rows that the matrix connects, so that two pools beside a wall stay apart; a row
without a connection left, or held by a known pressure above all, is left to the sweeps. The first level that is
small enough is the last one (``coarsest.py``).
"""

from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

from spume import kernels, lanes, team
from spume.pressure.entries import SINGLES, Entries, entry_functions, matrix_type
from spume.pressure.matrix import UNKNOWN

LEVELS = 20
"""Levels that there is room for; cells double 18 times before they are used up."""
CELL = 2.0
"""Width of the first level's cells [l0]."""
MOST_CELLS = 2e6
"""Cells along an axis; their product in 3D must not exceed 64 bits. What lies farther apart shares them."""
DAMPING = 0.85
"""Of the Jacobi sweeps; below 1 it is safe for every diagonally dominant matrix. Lone rows are not damped."""
UNEVEN = 60.0
"""Ratio of diagonals in a cell from which on only strongly connected rows are joined there (a jump of density)."""
STRONG = 0.05
"""A connection is strong if |a_ij| is at least this part of sqrt(a_ii a_jj)."""
DOMINANT = 0.5
"""A coarse row that is tied to a known pressure by more than this part of its diagonal is left to the sweeps alone."""
SURVEYED = 1 << 15
"""Parts in which wide devices list the rows that have an equation."""

# Words of the table: first row and number of rows of each level, then these.
_COUNTERS = 2 * (LEVELS + 1)
DEPTH, SLOTS, OVERFLOW, SHAPE = _COUNTERS, _COUNTERS + 1, _COUNTERS + 2, _COUNTERS + 3
BAND = _COUNTERS + 6  # half the width of the coarsest level's band, -1 if that level is not solved directly
WRAPPED = _COUNTERS + 7  # 1 if rows that are far apart share a cell of the first level
TABLE = _COUNTERS + 8
TOO_FEW_ROWS, TOO_FEW_SLOTS = 1, 2


def blocks() -> int:
    """Return how many parts of the rows are worked on side by side, at most."""
    runtime = kernels.runtime()
    if runtime.wide:
        return SURVEYED
    return 1 if runtime.serial else team.most_parts()


def alone(rows: int) -> bool:
    """Return whether one thread, in a single launch, solves a table of so many rows faster than all of them.

    That takes the pool of threads no time to wake, and no stage of a cycle has to be agreed on.
    """
    runtime = kernels.runtime()
    if runtime.wide:
        return False
    return runtime.serial or rows * (runtime.threads - 1) < 3_000 * runtime.threads


def stretches(rows: int = 1) -> int:
    """Return how many stretches of rows are combined side by side; each has a marker for every one of so many rows."""
    runtime = kernels.runtime()
    if runtime.wide:
        return 0  # a row's columns are found by looking through those that it has
    return max(min(blocks(), kernels.LONGEST_ARRAY // rows), 1)


@kernels.cached
def level_type(entries: Entries) -> Any:
    """Return the type that holds the arrays of the particles' level, or of all coarse levels one after another.

    Args:
        entries: how the matrix entries are stored. All other reals are of single precision: half the bytes, and a
            preconditioner needs no more.
    """
    Singles, Rows = (kernels.array_type(t) for t in (kernels.f32, kernels.i32))
    Reals, Matrix = kernels.array_type(kernels.runtime().real), matrix_type(entries)

    @dataclass
    class Level(Matrix):  # type: ignore[misc, valid-type]
        row: Rows  # type: ignore[valid-type]  # rows that have an equation, in ascending order
        diagonal: Singles  # type: ignore[valid-type]
        excess: Singles  # type: ignore[valid-type]  # sum of a coarse row, the diagonal included
        inverse: Singles  # type: ignore[valid-type]  # of the diagonal, damped; 0 for a row that has no equation
        aggregate: Rows  # type: ignore[valid-type]  # row of the next level, -1 for none
        member: Rows  # type: ignore[valid-type]  # rows of this level by aggregate
        first: Rows  # type: ignore[valid-type]  # members of a row of the level before: first,
        last: Rows  # type: ignore[valid-type]  # behind the last
        cell: Rows  # type: ignore[valid-type]
        right: Singles  # type: ignore[valid-type]  # right side, or what remains of it
        old: Singles  # type: ignore[valid-type]  # correction before,
        new: Singles  # type: ignore[valid-type]  # and after the last sweep
        image: Singles  # type: ignore[valid-type]  # A new
        kept: Singles  # type: ignore[valid-type]  # first direction of the inner iteration
        band: Reals  # type: ignore[valid-type]  # the coarsest level's matrix, once it is eliminated

    return Level


@kernels.cached
def scratch_type() -> Any:
    """Return the type that holds what the building of levels needs for a while."""
    Rows = kernels.array_type(kernels.i32)

    @dataclass
    class Scratch:
        begin: Rows  # type: ignore[valid-type]  # first row of a cell
        cursor: Rows  # type: ignore[valid-type]
        base: Rows  # type: ignore[valid-type]  # first aggregate of a cell
        order: Rows  # type: ignore[valid-type]  # rows by cell
        label: Rows  # type: ignore[valid-type]  # smallest connected row of the same cell
        marker: Rows  # type: ignore[valid-type]  # slot of a column
        sums: Rows  # type: ignore[valid-type]
        counts: Rows  # type: ignore[valid-type]  # rows that have an equation, by part

    return Scratch


@kernels.cached
def stages(entries: Entries, finest: bool) -> Any:
    """Return the stages of building a level, as functions of one block of rows, cells or aggregates.

    Args:
        entries: how the matrix entries of the level before are stored.
        finest: whether that is the particles' level.
    """
    qd, real = kernels.qd, kernels.runtime().real
    i32, i64, f32 = kernels.i32, kernels.i64, kernels.f32
    Level, Coarse, Scratch = level_type(entries), level_type(SINGLES), scratch_type()
    Rows, Reals = kernels.array_type(i32), kernels.array_type(real)
    entry, stride = entry_functions(Level, entries), lanes.stride()
    tiny = 1e-10 if kernels.runtime().precision == "double" else 1e-4
    huge = 1e30

    bound = lanes.parts_of().row

    @kernels.func
    def zero(b: i32, parts: i32, data: Rows, n: i32, value: i32):  # type: ignore[no-untyped-def, valid-type]
        for c in range(bound(b, parts, n), bound(b + 1, parts, n)):
            data[c] = value

    @kernels.func
    def shape(table: Rows, level: i32, axis: i32):  # type: ignore[no-untyped-def, valid-type]
        return ((table[SHAPE + axis] - 1) >> level) + 1

    @kernels.func
    def cells(table: Rows, level: i32):  # type: ignore[no-untyped-def, valid-type]
        return shape(table, level, 0) * shape(table, level, 1) * shape(table, level, 2)

    @kernels.func
    def place(b: i32, parts: i32, level: Level, at: i32, n: i32, k: i32, scratch: Scratch, table: Rows):  # type: ignore[no-untyped-def, valid-type]
        """Count the rows of coarse level k into cells twice as wide, which stand in ``aggregate`` for a while."""
        s0 = shape(table, k - 1, 0)
        s1 = shape(table, k - 1, 1)
        t0 = shape(table, k, 0)
        t1 = shape(table, k, 1)
        for i in range(at + bound(b, parts, n), at + bound(b + 1, parts, n)):
            c = -1
            if level.length[i] > 0 and level.excess[i] <= DOMINANT * level.diagonal[i]:
                old = level.cell[i]
                c = (old % s0) // 2 + t0 * ((old // s0 % s1) // 2 + t1 * (old // (s0 * s1) // 2))
                qd.atomic_add(scratch.cursor[c], 1)
            level.aggregate[i] = c

    @kernels.func
    def scan(n: i32, counts: Rows, start: Rows):  # type: ignore[no-untyped-def, valid-type]
        """Exclusive sums of counts; counts end up equal to the starts, to serve as cursors."""
        total = 0
        for c in range(n):
            own = counts[c]
            start[c] = total
            counts[c] = total
            total += own
        start[n] = total
        return total

    @kernels.func
    def scatter(b: i32, parts: i32, level: Level, at: i32, n: i32, scratch: Scratch):  # type: ignore[no-untyped-def, valid-type]
        for t in range(bound(b, parts, n), bound(b + 1, parts, n)):
            i = level.row[at + t]
            c = level.aggregate[at + i]
            if c >= 0:
                scratch.order[qd.atomic_add(scratch.cursor[c], 1)] = i

    @kernels.func
    def split(b: i32, parts: i32, level: Level, at: i32, n: i32, apart: i32, scratch: Scratch):  # type: ignore[no-untyped-def, valid-type]
        """Count the aggregates of each cell; ``apart``: one for each connected part, else one.

        Where diagonals differ as much as across a jump of density, the parts are those that strong connections
        join; a handful of cells is too few for that, or the coarsest level would not be reached.
        """
        for c in range(bound(b, parts, n), bound(b + 1, parts, n)):
            begin = scratch.begin[c]
            end = scratch.begin[c + 1]
            # The order must not depend on which thread came first.
            for s in range(begin + 1, end):
                row = scratch.order[s]
                t = s - 1
                while t >= begin and scratch.order[qd.max(t, 0)] > row:
                    scratch.order[t + 1] = scratch.order[t]
                    t -= 1
                scratch.order[t + 1] = row
            found = qd.cast(end > begin, i32)
            lowest = qd.cast(huge, f32)
            highest = qd.cast(0, f32)
            for s in range(begin, end):
                lowest = qd.min(lowest, level.diagonal[at + scratch.order[s]])
                highest = qd.max(highest, level.diagonal[at + scratch.order[s]])
            strong = qd.cast(0, f32)
            if n > 8 and highest > UNEVEN * lowest:
                strong = STRONG**2
            if (apart == 1 or strong > 0) and end > begin + 1:
                for s in range(begin, end):
                    scratch.label[scratch.order[s]] = scratch.order[s]
                changed = 1
                while changed == 1:
                    changed = 0
                    for s in range(begin, end):
                        i = scratch.order[s]
                        least = scratch.label[i]
                        first = level.start[at + i]
                        chunk = entry.chunk(level, at + i)
                        for q in range(level.length[at + i]):
                            k = first + q * stride
                            j = entry.column(level, chunk, k)
                            if level.aggregate[at + j] == c:
                                v = qd.cast(entry.value(level, chunk, k), f32)
                                if v * v >= strong * level.diagonal[at + i] * level.diagonal[at + j]:
                                    least = qd.min(least, scratch.label[j])
                        if least < scratch.label[i]:
                            scratch.label[i] = least
                            changed = 1
                found = 0
                for s in range(begin, end):
                    if scratch.label[scratch.order[s]] == scratch.order[s]:
                        found += 1
            elif found == 1:
                # A cell's only aggregate needs no labels: its first row stands for all.
                for s in range(begin, end):
                    scratch.label[scratch.order[s]] = scratch.order[begin]
            scratch.cursor[c] = found

    @kernels.func
    def number(
        b: i32, parts: i32, level: Level, at: i32, coarse: Coarse, to: i32, n: i32, scratch: Scratch,  # type: ignore[valid-type]
    ):  # fmt: skip
        """Number the aggregates of each cell and list their rows."""
        for c in range(bound(b, parts, n), bound(b + 1, parts, n)):
            begin = scratch.begin[c]
            end = scratch.begin[c + 1]
            own = scratch.base[c]
            at_member = begin
            for s in range(begin, end):
                root = scratch.order[s]
                if scratch.label[root] == root:
                    coarse.first[to + own] = at_member
                    for t in range(s, end):
                        i = scratch.order[t]
                        if scratch.label[i] == root:
                            level.member[at + at_member] = i
                            level.aggregate[at + i] = own
                            at_member += 1
                    coarse.last[to + own] = at_member
                    coarse.cell[to + own] = c
                    own += 1

    @kernels.func
    def finish(
        coarse: Coarse, row: i32, own: i32, first: i32, length: i32, total: real, excess: real, size: real,  # type: ignore[valid-type]
    ):  # fmt: skip
        """Note what a coarse row is made of: its entries beside the diagonal, the diagonal and the sum of all."""
        coarse.start[row] = first
        coarse.length[row] = length
        coarse.diagonal[row] = qd.cast(total, f32)
        coarse.excess[row] = qd.cast(excess, f32)
        # Without a tie to a known pressure an aggregate that stands alone has no equation left.
        weight = qd.select(length > 0, qd.cast(DAMPING, real), qd.cast(1, real))
        inverse = qd.select(total > tiny * size, weight / qd.max(total, tiny * size), qd.cast(0, real))
        coarse.inverse[row] = qd.cast(inverse, f32)
        coarse.row[row] = own

    @kernels.func
    def combine(
        b: i32, parts: i32, level: Level, diagonal: Reals, at: i32, coarse: Coarse, to: i32, n: i32, slots: i32,  # type: ignore[valid-type]
        room: i32, scratch: Scratch, table: Rows,  # type: ignore[valid-type]
    ):  # fmt: skip
        """Sum the rows and columns of each aggregate; a block's rows lie packed in its stretch of the slots.

        The sum of a coarse row is that of the sums of its rows; with it the diagonal does not suffer from
        cancellation, however weakly an aggregate is tied to a known pressure.
        """
        begin = bound(b, parts, n)
        end = bound(b + 1, parts, n)
        cursor = slots + qd.cast(qd.cast(room, i64) * b // parts, i32)
        limit = slots + qd.cast(qd.cast(room, i64) * (b + 1) // parts, i32)
        marker = b * n
        for c in range(n):
            scratch.marker[marker + c] = -1
        for own in range(begin, end):
            # The first slot takes what lies inside the aggregate, so that no entry needs a question of its own.
            first = cursor
            cursor += 1
            if cursor > limit:
                qd.atomic_or(table[OVERFLOW], TOO_FEW_SLOTS)
                cursor = first
                continue
            scratch.marker[marker + own] = first
            coarse.value[first] = 0
            excess = qd.cast(0, real)
            size = qd.cast(0, real)
            for s in range(coarse.first[to + own], coarse.last[to + own]):
                i = at + level.member[at + s]
                size += level.diagonal[i]
                if kernels.static(finest):
                    excess += diagonal[i]
                else:
                    excess += level.excess[i]
                start = level.start[i]
                chunk = entry.chunk(level, i)
                for k in range(start, start + level.length[i]):
                    j = level.aggregate[at + entry.column(level, chunk, k)]
                    v = entry.value(level, chunk, k)
                    if kernels.static(finest):
                        excess += v
                    if j < 0:
                        # A row that is left to the sweeps counts as known.
                        excess -= v
                    else:
                        m = scratch.marker[marker + j]
                        if m >= first:
                            coarse.value[m] = coarse.value[m] + qd.cast(v, f32)
                        elif cursor < limit:
                            scratch.marker[marker + j] = cursor
                            coarse.column[cursor] = j
                            coarse.value[cursor] = qd.cast(v, f32)
                            cursor += 1
                        else:
                            qd.atomic_or(table[OVERFLOW], TOO_FEW_SLOTS)
            coarse.column[first] = own
            cursor -= 1
            # The last entry takes that slot, and the next row the last entry's.
            scratch.marker[marker + coarse.column[cursor]] = -1
            coarse.column[first] = coarse.column[cursor]
            coarse.value[first] = coarse.value[cursor]
            total = excess
            for k in range(first, cursor):
                total -= coarse.value[k]
            finish(coarse, to + own, own, first, cursor - first, total, excess, size)
        return cursor

    return SimpleNamespace(
        bound=bound, zero=zero, shape=shape, cells=cells, place=place, scan=scan,
        scatter=scatter, split=split, number=number, combine=combine, finish=finish,
    )  # fmt: skip


@kernels.cached
def particle_stages(d: int, entries: Entries) -> Any:
    """Return the stages that read positions: the bounds of the unknown rows and their cells."""
    qd, real = kernels.qd, kernels.runtime().real
    i32, f32 = kernels.i32, kernels.f32
    Level, Scratch = level_type(entries), scratch_type()
    Rows, Reals, Vectors = (kernels.array_type(t) for t in (i32, real, kernels.vector(d)))
    bound = lanes.parts_of().bound
    huge = 1e30

    @kernels.func
    def survey(
        b: i32, parts: i32, position: Vectors, state: Rows, low: Vectors, high: Vectors, counts: Rows, n: i32,  # type: ignore[valid-type]
    ):  # fmt: skip
        """Count the unknown rows and find their bounds."""
        lowest = position[0] * 0 + huge
        highest = position[0] * 0 - huge
        found = 0
        for i in range(bound(b, parts, n), bound(b + 1, parts, n)):
            if state[i] == UNKNOWN:
                lowest = qd.min(lowest, position[i])
                highest = qd.max(highest, position[i])
                found += 1
        low[b] = lowest
        high[b] = highest
        counts[b] = found

    @kernels.func
    def bring_together(c: i32, left: i32, parts: i32, low: Vectors, high: Vectors):  # type: ignore[no-untyped-def, valid-type]
        """Leave fewer bounds, of which this is number c."""
        for k in range(1, parts // left):
            low[c] = qd.min(low[c], low[c + k * left])
            high[c] = qd.max(high[c], high[c + k * left])

    @kernels.func
    def sum_counts(parts: i32, counts: Rows):  # type: ignore[no-untyped-def, valid-type]
        total = 0
        for b in range(parts):
            own = counts[b]
            counts[b] = total
            total += own
        return total

    @kernels.func
    def grid(parts: i32, low: Vectors, high: Vectors, total: i32, table: Rows, cell: real, most: i32):  # type: ignore[no-untyped-def, valid-type]
        """Choose the cells of the first level; where there would be too many, far apart ones are one."""
        lowest = low[0]
        highest = high[0]
        for b in range(parts):
            lowest = qd.min(lowest, low[b])
            highest = qd.max(highest, high[b])
        low[0] = lowest
        table[0] = 0
        table[1] = total
        table[DEPTH] = 1
        table[SLOTS] = 0
        table[OVERFLOW] = 0
        table[BAND] = -1
        table[WRAPPED] = 0
        for axis in range(3):
            table[SHAPE + axis] = 1
        for axis in kernels.static(range(d)):
            extent = (highest[axis] - lowest[axis]) / cell
            if extent > MOST_CELLS:
                table[WRAPPED] = 1
            table[SHAPE + axis] = qd.cast(qd.min(qd.max(extent, 0.0), MOST_CELLS), i32) + 2
        while qd.cast(table[SHAPE], qd.i64) * table[SHAPE + 1] * table[SHAPE + 2] > most:
            longest = 0
            for axis in range(3):
                if table[SHAPE + axis] > table[SHAPE + longest]:
                    longest = axis
            table[SHAPE + longest] = table[SHAPE + longest] // 2
            table[WRAPPED] = 1

    @kernels.func
    def place_particles(
        b: i32, parts: i32, level: Level, diagonal: Reals, position: Vectors, state: Rows, low: Vectors, counts: Rows,  # type: ignore[valid-type]
        scratch: Scratch, table: Rows, cell: real, n: i32,  # type: ignore[valid-type]
    ):  # fmt: skip
        """List the unknown rows and count the connected ones into the cells of the first level."""
        # Cells are aligned to multiples of their width, so that they move only as a whole.
        origin = qd.floor(low[0] / cell)
        found = counts[b]
        for i in range(bound(b, parts, n), bound(b + 1, parts, n)):
            c = -1
            inverse = qd.cast(0, real)
            if state[i] == UNKNOWN:
                level.row[found] = i
                found += 1
                if diagonal[i] > 0:
                    inverse = 1 / diagonal[i]
                if level.length[i] > 0:
                    inverse *= DAMPING
                    index = qd.floor(position[i] / cell) - origin
                    c = 0
                    for q in kernels.static(range(d)):
                        axis = kernels.static(d - 1 - q)
                        s = table[SHAPE + axis]
                        # A position that is no number must not point outside.
                        c = c * s + qd.max(qd.cast(index[axis], i32) % s, 0)
                    qd.atomic_add(scratch.cursor[c], 1)
            level.diagonal[i] = qd.cast(diagonal[i], f32)
            level.inverse[i] = qd.cast(inverse, f32)
            level.aggregate[i] = c

    return SimpleNamespace(
        survey=survey, bring_together=bring_together, sum_counts=sum_counts, grid=grid, place_particles=place_particles
    )
