"""The multigrid cycle and the flexible conjugate gradients around it.

One damped Jacobi sweep before the coarse correction, from zero, and one after it: a cycle and the image of
its result cost three products with the matrix on a level. Whoever sets a right side makes the first sweep with it,
so that it needs no loop of its own. (Gauss-Seidel sweeps took the same number of
iterations and half a product less, but their short dependent loops made an iteration 1.2 to 1.5 times slower.)
"""

from collections.abc import Collection, Sequence
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

from spume import kernels, lanes
from spume.pressure.aggregation import BAND, level_type, stages
from spume.pressure.base import square_of_row
from spume.pressure.coarsest import direct_stages
from spume.pressure.entries import SINGLES, Entries, row_sum

RESTRICT, CORRECT, POLISH, SOLVE, FIRST, SECOND, RUN = range(7)
"""Operations on a level that a program consists of; RUN stands for several in a row."""

# Scalars of the outer iteration; from SCALARS on, four of each level.
RIGHT, REST, IMAGE_OF_DIRECTION, ITERATIONS, STEP, TURN = 0, 1, 2, 4, 5, 6
SCALARS = 8

SHRINKING = 0.6
"""Largest ratio of the rows of two levels at which inner iterations on the finer one pay."""

ENOUGH = 0.25
"""Part of the residual that the first inner iteration may leave for there to be no second (Notay & Vassilevski 2008);
the graph of wide devices makes the second one anyway."""


def inner_levels(rows: Sequence[int], most: int) -> frozenset[int]:
    """Return the levels whose coarse problem takes two steps of flexible conjugate gradients instead of one cycle.

    Every such level doubles the visits to all levels below. Where the next one is hardly smaller, as when drops and
    films are left over, that would cost more than it saves.

    Args:
        rows: of each coarse level.
        most: number of coarse levels that may be among them, the finest first.
    """
    pairs = list(pairwise(rows))[:most]
    return frozenset(level for level, (own, next_) in enumerate(pairs, 1) if next_ <= SHRINKING * own)


def program(depth: int, inner: Collection[int]) -> list[tuple[int, int]]:
    """Return the operations that solve on level 1, as (operation, level).

    Args:
        depth: number of levels, the particles' included.
        inner: levels that are solved by two steps of flexible conjugate gradients (K-cycle, Notay & Vassilevski
            2008); the others by one cycle.
    """
    operations: list[tuple[int, int]] = []

    def cycle(level: int) -> None:
        operations.append((RESTRICT, level))
        solve(level + 1)
        operations.extend([(CORRECT, level), (POLISH, level)])

    def solve(level: int) -> None:
        if level + 1 == depth:
            operations.append((SOLVE, level))
            return
        cycle(level)
        if level in inner:
            operations.append((FIRST, level))
            cycle(level)
            operations.append((SECOND, level))

    if depth > 1:
        solve(1)
    return operations


@kernels.cached
def cycle_stages(symmetric: bool, entries: Entries) -> Any:
    """Return the parts of the cycle, as functions of one block of rows.

    Inner and outer iterations choose their steps by products with a test vector t: t = z of a correction z for a
    symmetric matrix (conjugate gradients, least energy), t = A z else (conjugate residuals, least residual).
    """
    qd, real = kernels.qd, kernels.runtime().real
    i32, f32 = kernels.i32, kernels.f32
    Level, Coarse = level_type(entries), level_type(SINGLES)
    Reals = kernels.array_type(real)
    bound, total = stages(entries, entries != SINGLES).bound, lanes.fold().total
    add, subtract = (row_sum(Level, entries, sign, f32, f32) for sign in "+-")

    @kernels.func
    def rest_of(level: Level, at: i32, i: i32):  # type: ignore[no-untyped-def, valid-type]
        """Return row i of right - A old."""
        return subtract(level, i, at, level.old, level.right[i] - level.diagonal[i] * level.old[i])

    @kernels.func
    def leave(b: i32, parts: i32, level: Level, at: i32, n: i32):  # type: ignore[no-untyped-def, valid-type]
        """Put what the sweep left over into ``new``, which is free until ``polish``."""
        for t in range(at + bound(b, parts, n), at + bound(b + 1, parts, n)):
            i = at + level.row[t]
            level.new[i] = rest_of(level, at, i)

    @kernels.func
    def restrict(b: i32, parts: i32, level: Level, at: i32, coarse: Coarse, to: i32, n: i32):  # type: ignore[no-untyped-def, valid-type]
        """Sum what the sweep left over in each aggregate, and sweep from zero with it there."""
        for own in range(to + bound(b, parts, n), to + bound(b + 1, parts, n)):
            s = qd.cast(0, f32)
            for m in range(coarse.first[own], coarse.last[own]):
                s += level.new[at + level.member[at + m]]
            coarse.right[own] = s
            coarse.old[own] = s * coarse.inverse[own]

    @kernels.func
    def correct(b: i32, parts: i32, level: Level, at: i32, n: i32, coarse: Coarse, to: i32):  # type: ignore[no-untyped-def, valid-type]
        for t in range(at + bound(b, parts, n), at + bound(b + 1, parts, n)):
            i = at + level.row[t]
            c = level.aggregate[i]
            if c >= 0:
                level.old[i] = level.old[i] + coarse.new[to + c]

    @kernels.func
    def polish(b: i32, parts: i32, level: Level, at: i32, n: i32):  # type: ignore[no-untyped-def, valid-type]
        """Sweep once more."""
        for t in range(at + bound(b, parts, n), at + bound(b + 1, parts, n)):
            i = at + level.row[t]
            level.new[i] = level.old[i] + rest_of(level, at, i) * level.inverse[i]

    @kernels.func
    def image_of(level: Level, at: i32, i: i32):  # type: ignore[no-untyped-def, valid-type]
        """Return row i of A new."""
        return add(level, i, at, level.new, level.diagonal[i] * level.new[i])

    @kernels.func
    def first_products(b: i32, parts: i32, level: Level, at: i32, n: i32, partial: Reals):  # type: ignore[no-untyped-def, valid-type]
        energy = qd.cast(0, real)
        share = qd.cast(0, real)
        size = qd.cast(0, real)
        for t in range(at + bound(b, parts, n), at + bound(b + 1, parts, n)):
            i = at + level.row[t]
            s = image_of(level, at, i)
            t_i = s
            if kernels.static(symmetric):
                t_i = level.new[i]
            level.image[i] = s
            energy += qd.cast(s * t_i, real)
            share += qd.cast(level.right[i] * t_i, real)
            size += qd.cast(level.right[i] * level.right[i], real)
        partial[3 * b] = energy
        partial[3 * b + 1] = share
        partial[3 * b + 2] = size

    @kernels.func
    def second_products(b: i32, parts: i32, level: Level, at: i32, n: i32, partial: Reals):  # type: ignore[no-untyped-def, valid-type]
        energy = qd.cast(0, real)
        share = qd.cast(0, real)
        overlap = qd.cast(0, real)
        for t in range(at + bound(b, parts, n), at + bound(b + 1, parts, n)):
            i = at + level.row[t]
            s = image_of(level, at, i)
            t_i = s
            if kernels.static(symmetric):
                t_i = level.new[i]
            energy += qd.cast(s * t_i, real)
            share += qd.cast(level.right[i] * t_i, real)
            overlap += qd.cast(level.image[i] * t_i, real)
        partial[3 * b] = energy
        partial[3 * b + 1] = share
        partial[3 * b + 2] = overlap

    @kernels.func
    def ratio(a: real, b: real):  # type: ignore[no-untyped-def, valid-type]
        """Return a/b, 0 where b is not positive: the search direction is then left out."""
        return qd.select(b > 0, a / qd.select(b > 0, b, qd.cast(1, real)), qd.cast(0, real))

    @kernels.func
    def first_scalars(parts: i32, level: i32, partial: Reals, scalars: Reals):  # type: ignore[no-untyped-def, valid-type]
        energy = total(partial, parts, 0)
        scalars[SCALARS + 4 * level] = energy
        scalars[SCALARS + 4 * level + 1] = ratio(total(partial, parts, 1), energy)
        scalars[SCALARS + 4 * level + 2] = total(partial, parts, 2)

    @kernels.func
    def first_step(  # type: ignore[no-untyped-def]
        b: i32, parts: i32, level: Level, at: i32, n: i32, number: i32, partial: Reals, scalars: Reals,  # type: ignore[valid-type]
    ):  # fmt: skip
        step = qd.cast(scalars[SCALARS + 4 * number + 1], f32)
        left = qd.cast(0, real)
        for t in range(at + bound(b, parts, n), at + bound(b + 1, parts, n)):
            i = at + level.row[t]
            rest = level.right[i] - step * level.image[i]
            level.right[i] = rest
            level.old[i] = rest * level.inverse[i]
            level.kept[i] = level.new[i]
            left += qd.cast(rest * rest, real)
        partial[3 * b] = left

    @kernels.func
    def enough(parts: i32, level: i32, partial: Reals, scalars: Reals):  # type: ignore[no-untyped-def, valid-type]
        """Return whether the first inner iteration was enough; ``second_step`` then only takes its step."""
        done = total(partial, parts, 0) <= ENOUGH**2 * scalars[SCALARS + 4 * level + 2]
        if done:
            scalars[SCALARS + 4 * level + 2] = 0
            scalars[SCALARS + 4 * level + 3] = scalars[SCALARS + 4 * level + 1]
        return done

    @kernels.func
    def second_scalars(parts: i32, level: i32, partial: Reals, scalars: Reals):  # type: ignore[no-untyped-def, valid-type]
        energy = scalars[SCALARS + 4 * level]
        overlap = total(partial, parts, 2)
        step = ratio(total(partial, parts, 1), total(partial, parts, 0) - overlap * ratio(overlap, energy))
        scalars[SCALARS + 4 * level + 2] = step
        scalars[SCALARS + 4 * level + 3] = scalars[SCALARS + 4 * level + 1] - step * ratio(overlap, energy)

    @kernels.func
    def second_step(b: i32, parts: i32, level: Level, at: i32, n: i32, number: i32, scalars: Reals):  # type: ignore[no-untyped-def, valid-type]
        step = qd.cast(scalars[SCALARS + 4 * number + 2], f32)
        kept = qd.cast(scalars[SCALARS + 4 * number + 3], f32)
        for t in range(at + bound(b, parts, n), at + bound(b + 1, parts, n)):
            i = at + level.row[t]
            level.new[i] = kept * level.kept[i] + step * level.new[i]

    return SimpleNamespace(
        leave=leave, restrict=restrict, correct=correct, polish=polish, image_of=image_of,
        first_products=first_products, first_scalars=first_scalars, first_step=first_step, enough=enough,
        second_products=second_products, second_scalars=second_scalars, second_step=second_step,
        total=total, ratio=ratio,
    )  # fmt: skip


@kernels.cached
def outer_stages(symmetric: bool, entries: Entries) -> Any:
    """Return the parts of the outer iteration, as functions of one block of rows, in the run's precision."""
    qd, real = kernels.qd, kernels.runtime().real
    i32, f32 = kernels.i32, kernels.f32
    Level = level_type(entries)
    Reals = kernels.array_type(real)
    subtract, add = row_sum(Level, entries, "-", real, real), row_sum(Level, entries, "+", real, f32)
    shared = cycle_stages(symmetric, entries)
    bound, total, ratio = stages(entries, entries != SINGLES).bound, shared.total, shared.ratio

    @kernels.func
    def residual(
        b: i32, parts: i32, level: Level, diagonal: Reals, x: Reals, rhs: Reals, r: Reals, p: Reals, q: Reals,  # type: ignore[valid-type]
        partial: Reals, floor: real, loosest: real, n: i32,  # type: ignore[valid-type]
    ):  # fmt: skip
        bb = qd.cast(0, real)
        rr = qd.cast(0, real)
        for t in range(bound(b, parts, n), bound(b + 1, parts, n)):
            i = level.row[t]
            rest = subtract(level, i, 0, x, rhs[i] - diagonal[i] * x[i])
            bb += square_of_row(rhs[i], diagonal[i] * x[i], floor, loosest)
            r[i] = rest
            level.right[i] = qd.cast(rest, f32)
            level.old[i] = level.right[i] * level.inverse[i]
            p[i] = 0
            q[i] = 0
            rr += rest * rest
        partial[3 * b] = bb
        partial[3 * b + 1] = rr

    @kernels.func
    def begin(parts: i32, partial: Reals, scalars: Reals):  # type: ignore[no-untyped-def, valid-type]
        scalars[RIGHT] = total(partial, parts, 0)
        scalars[REST] = total(partial, parts, 1)
        scalars[IMAGE_OF_DIRECTION] = 0
        scalars[ITERATIONS] = 0

    @kernels.func
    def products(
        b: i32, parts: i32, level: Level, diagonal: Reals, r: Reals, q: Reals, image: Reals, partial: Reals, n: i32,  # type: ignore[valid-type]
    ):  # fmt: skip
        energy = qd.cast(0, real)
        share = qd.cast(0, real)
        overlap = qd.cast(0, real)
        for t in range(bound(b, parts, n), bound(b + 1, parts, n)):
            i = level.row[t]
            s = add(level, i, 0, level.new, diagonal[i] * level.new[i])
            t_i = s
            if kernels.static(symmetric):
                t_i = qd.cast(level.new[i], real)
            image[i] = s
            energy += s * t_i
            share += r[i] * t_i
            overlap += q[i] * t_i
        partial[3 * b] = energy
        partial[3 * b + 1] = share
        partial[3 * b + 2] = overlap

    @kernels.func
    def decide(parts: i32, partial: Reals, scalars: Reals):  # type: ignore[no-untyped-def, valid-type]
        """Make the new direction conjugate to the one before (equal to the formula of Polak and Ribière)."""
        overlap = total(partial, parts, 2)
        turn = -ratio(overlap, scalars[IMAGE_OF_DIRECTION])
        energy = total(partial, parts, 0) + turn * overlap
        scalars[TURN] = turn
        scalars[IMAGE_OF_DIRECTION] = energy
        scalars[STEP] = ratio(total(partial, parts, 1), energy)
        scalars[ITERATIONS] += 1

    @kernels.func
    def advance(
        b: i32, parts: i32, level: Level, x: Reals, r: Reals, p: Reals, q: Reals, image: Reals, partial: Reals,  # type: ignore[valid-type]
        scalars: Reals, n: i32,  # type: ignore[valid-type]
    ):  # fmt: skip
        turn = scalars[TURN]
        step = scalars[STEP]
        rr = qd.cast(0, real)
        for t in range(bound(b, parts, n), bound(b + 1, parts, n)):
            i = level.row[t]
            p[i] = level.new[i] + turn * p[i]
            q[i] = image[i] + turn * q[i]
            x[i] = x[i] + step * p[i]
            rest = r[i] - step * q[i]
            r[i] = rest
            level.right[i] = qd.cast(rest, f32)
            level.old[i] = level.right[i] * level.inverse[i]
            rr += rest * rest
        partial[3 * b] = rr

    return SimpleNamespace(
        residual=residual, begin=begin, products=products, decide=decide, advance=advance, total=total
    )


@kernels.cached
def run_function(symmetric: bool) -> Any:
    """Return the function that runs a program on the coarse levels in one thread."""
    i32 = kernels.i32
    Coarse = level_type(SINGLES)
    Reals, Rows = kernels.array_type(kernels.runtime().real), kernels.array_type(i32)
    c, solve = cycle_stages(symmetric, SINGLES), direct_stages().solve

    @kernels.func
    def run(operations: Rows, first: i32, last: i32, coarse: Coarse, table: Rows, partial: Reals, scalars: Reals):  # type: ignore[no-untyped-def, valid-type]
        step = first
        while step < last:
            operation = operations[2 * step]
            level = operations[2 * step + 1]
            at = table[2 * level]
            n = table[2 * level + 1]
            if operation == RESTRICT:
                c.leave(0, 1, coarse, at, n)
                c.restrict(0, 1, coarse, at, coarse, at + n, table[2 * level + 3])
            elif operation == CORRECT:
                c.correct(0, 1, coarse, at, n, coarse, at + n)
            elif operation == POLISH:
                c.polish(0, 1, coarse, at, n)
            elif operation == SOLVE:
                if table[BAND] >= 0:
                    solve(coarse, at, n, table[BAND])
                else:
                    # Rows that stand alone, for which the sweep is exact, or nearly so.
                    c.polish(0, 1, coarse, at, n)
            elif operation == FIRST:
                c.first_products(0, 1, coarse, at, n, partial)
                c.first_scalars(1, level, partial, scalars)
                c.first_step(0, 1, coarse, at, n, level, partial, scalars)
                if c.enough(1, level, partial, scalars):
                    while operations[2 * step] != SECOND or operations[2 * step + 1] != level:
                        step += 1
                    c.second_step(0, 1, coarse, at, n, level, scalars)
            else:
                c.second_products(0, 1, coarse, at, n, partial)
                c.second_scalars(1, level, partial, scalars)
                c.second_step(0, 1, coarse, at, n, level, scalars)
            step += 1

    return run


@kernels.cached
def solve_in_one_thread(symmetric: bool, entries: Entries) -> Any:
    """Return the kernel that iterates in one go."""
    qd, real = kernels.qd, kernels.runtime().real
    i32 = kernels.i32
    Level, Coarse = level_type(entries), level_type(SINGLES)
    Reals, Rows = kernels.array_type(real), kernels.array_type(i32)
    f, o, run = cycle_stages(symmetric, entries), outer_stages(symmetric, entries), run_function(symmetric)

    @kernels.kernel
    def solve_by_multigrid(
        level: Level, coarse: Coarse, table: Rows, operations: Rows, length: i32, diagonal: Reals, x: Reals,  # type: ignore[valid-type]
        rhs: Reals, r: Reals, p: Reals, q: Reals, image: Reals, partial: Reals, scalars: Reals, tolerance: real,  # type: ignore[valid-type]
        floor: real, loosest: real, largest: i32,  # type: ignore[valid-type]
    ):  # fmt: skip
        qd.loop_config(serialize=True)
        for _ in range(1):
            n = table[1]
            o.residual(0, 1, level, diagonal, x, rhs, r, p, q, partial, floor, loosest, n)
            o.begin(1, partial, scalars)
            while scalars[REST] > tolerance * tolerance * scalars[RIGHT] and scalars[ITERATIONS] < largest:
                if length > 0:
                    f.leave(0, 1, level, 0, n)
                    f.restrict(0, 1, level, 0, coarse, 0, table[3])
                    run(operations, 0, length, coarse, table, partial, scalars)
                    f.correct(0, 1, level, 0, n, coarse, 0)
                f.polish(0, 1, level, 0, n)
                o.products(0, 1, level, diagonal, r, q, image, partial, n)
                o.decide(1, partial, scalars)
                o.advance(0, 1, level, x, r, p, q, image, partial, scalars, n)
                scalars[REST] = partial[0]

    return solve_by_multigrid
