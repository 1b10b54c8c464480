"""The coarsest level of the multigrid method, which is solved directly: elimination within the band of its matrix.

Rows are in the order of their cells, so entries lie near the diagonal. Pivots are made as diagonals of coarse rows are:
what a row sums to, which is eliminated along with it, less its other entries (Grassmann, Taksar & Heyman 1985). So a
level that is tied ever so weakly to a known pressure does not lose that tie to rounding. A row whose pivot is nothing
but rounding belongs to a part of the water without a known pressure; its correction is zero.
"""

from types import SimpleNamespace
from typing import Any

from spume import kernels, lanes
from spume.pressure.aggregation import BAND, level_type
from spume.pressure.entries import SINGLES

MOST_ROWS = 1024
"""Levels with more rows are not solved directly."""
MOST_ROWS_OF_ONE_LANE = 12
"""On wide devices, where one thread is slow and a level more costs little."""
MOST_SLOTS = 1 << 16
"""Numbers in the band, at most."""
WORK = 4
"""Multiplications that an elimination may cost, per row of the finest level."""


def room() -> int:
    """Return the size of the array that holds the band and the sums of its rows."""
    return MOST_SLOTS + MOST_ROWS


@kernels.cached
def direct_stages() -> Any:
    """Return the functions that eliminate and that solve, for one thread."""
    qd, real = kernels.qd, kernels.runtime().real
    i32, i64, f32 = kernels.i32, kernels.i64, kernels.f32
    Level, Rows = level_type(SINGLES), kernels.array_type(i32)
    stride, wide = lanes.stride(), kernels.runtime().wide
    most_rows, work = (MOST_ROWS_OF_ONE_LANE, MOST_ROWS_OF_ONE_LANE**2) if wide else (MOST_ROWS, WORK)
    tiny = 1e-10 if kernels.runtime().precision == "double" else 1e-4

    @kernels.func
    def half_width(level: Level, at: i32, n: i32):  # type: ignore[no-untyped-def, valid-type]
        width = 0
        for i in range(n):
            first = level.start[at + i]
            for k in range(level.length[at + i]):
                width = qd.max(width, qd.abs(level.column[first + k * stride] - i))
        return width

    @kernels.func
    def eliminate(level: Level, at: i32, n: i32, width: i32):  # type: ignore[no-untyped-def, valid-type]
        size = 2 * width + 1
        for i in range(n):
            row = i * size + width - i
            for s in range(i * size, (i + 1) * size):
                level.band[s] = 0
            first = level.start[at + i]
            for q in range(level.length[at + i]):
                k = first + q * stride
                level.band[row + level.column[k]] = qd.cast(level.value[k], real)
            rest = qd.cast(level.excess[at + i], real)
            for k in range(qd.max(i - width, 0), i):
                above = k * size + width - k
                factor = level.band[row + k] * level.band[above + k]
                level.band[row + k] = factor
                if factor != 0:
                    for j in range(k + 1, qd.min(k + width + 1, n)):
                        level.band[row + j] = level.band[row + j] - factor * level.band[above + j]
                    rest -= factor * level.band[MOST_SLOTS + k]
            pivot = rest
            for j in range(i + 1, qd.min(i + width + 1, n)):
                pivot -= level.band[row + j]
            inverse = qd.cast(0, real)
            if qd.abs(pivot) > tiny * level.diagonal[at + i]:
                inverse = 1 / pivot
            level.band[row + i] = inverse
            level.band[MOST_SLOTS + i] = rest

    @kernels.func
    def factorise(level: Level, table: Rows, k: i32):  # type: ignore[no-untyped-def, valid-type]
        """Eliminate level k if that is cheap; return 1 if so."""
        at = table[2 * k]
        n = table[2 * k + 1]
        table[BAND] = -1
        done = 0
        if n <= most_rows:
            width = half_width(level, at, n)
            if n * (2 * width + 1) <= MOST_SLOTS and qd.cast(n, i64) * width * width <= qd.cast(table[1], i64) * work:
                eliminate(level, at, n, width)
                table[BAND] = width
                done = 1
        return done

    @kernels.func
    def solve(level: Level, at: i32, n: i32, width: i32):  # type: ignore[no-untyped-def, valid-type]
        """Set ``new`` to what solves the level for ``right``."""
        size = 2 * width + 1
        for i in range(n):
            row = i * size + width - i
            s = qd.cast(level.right[at + i], real)
            for k in range(qd.max(i - width, 0), i):
                s -= level.band[row + k] * level.new[at + k]
            level.new[at + i] = qd.cast(s, f32)
        for t in range(n):
            i = n - 1 - t
            row = i * size + width - i
            s = qd.cast(level.new[at + i], real)
            for k in range(i + 1, qd.min(i + width + 1, n)):
                s -= level.band[row + k] * level.new[at + k]
            level.new[at + i] = qd.cast(s * level.band[row + i], f32)

    return SimpleNamespace(factorise=factorise, solve=solve)
