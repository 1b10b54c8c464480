"""Sums and extremes over rows of some kinds.

They are made of a fixed number of partial ones, whatever the number of threads, and leave ``lanes.REDUCED`` numbers
to the processor.
"""

from typing import Any

import numpy as np

from spume import kernels, lanes


@kernels.cached
def largest_kernel(d: int, serial: bool) -> Any:
    """Return the kernel that finds the square of the largest length of a vector field."""
    real = kernels.runtime().real
    Vectors, Rows, Reals = (kernels.array_type(t) for t in (kernels.vector(d), kernels.i32, real))
    qd, blocks = kernels.qd, lanes.reduction_blocks()
    reduced, share = lanes.REDUCED, blocks // lanes.REDUCED
    spread = 1 if serial else kernels.spread(blocks)
    huge = float(np.finfo(kernels.runtime().dtype).max)

    @kernels.kernel
    def largest(field: Vectors, kind: Rows, partial: Reals, result: Reals, kinds: kernels.i32, count: kernels.i32):
        qd.loop_config(serialize=serial)
        for t in range(blocks * spread):
            if t % spread == 0:
                b = t // spread
                found = qd.cast(0, real)
                for i in range(
                    qd.cast(qd.cast(count, qd.i64) * b // blocks, qd.i32),
                    qd.cast(qd.cast(count, qd.i64) * (b + 1) // blocks, qd.i32),
                ):
                    if kind[i] & kinds != 0:
                        square = field[i].dot(field[i])
                        # NaN must win, but it would vanish in max().
                        if not (square < huge):
                            square = huge
                        found = qd.max(found, square)
                partial[b] = found
        qd.loop_config(serialize=serial)
        for c in range(reduced):
            found = qd.cast(0, real)
            for k in range(share):
                found = qd.max(found, partial[c + k * reduced])
            result[c] = found

    return largest


@kernels.cached
def total_kernel(integer: bool, serial: bool) -> Any:
    """Return the kernel that sums a scalar field."""
    real = kernels.runtime().real
    Values, Rows, Reals = (kernels.array_type(t) for t in (kernels.i32 if integer else real, kernels.i32, real))
    qd, blocks = kernels.qd, lanes.reduction_blocks()
    reduced, share = lanes.REDUCED, blocks // lanes.REDUCED
    spread = 1 if serial else kernels.spread(blocks)

    @kernels.kernel
    def total(field: Values, kind: Rows, partial: Reals, result: Reals, kinds: kernels.i32, count: kernels.i32):
        qd.loop_config(serialize=serial)
        for t in range(blocks * spread):
            if t % spread == 0:
                b = t // spread
                s = qd.cast(0, real)
                for i in range(
                    qd.cast(qd.cast(count, qd.i64) * b // blocks, qd.i32),
                    qd.cast(qd.cast(count, qd.i64) * (b + 1) // blocks, qd.i32),
                ):
                    if kind[i] & kinds != 0:
                        s += field[i]
                partial[b] = s
        qd.loop_config(serialize=serial)
        for c in range(reduced):
            s = qd.cast(0, real)
            for k in range(share):
                s += partial[c + k * reduced]
            result[c] = s

    return total


@kernels.cached
def extreme_kernel(largest: bool, serial: bool) -> Any:
    """Return the kernel that finds the smallest or the largest value of a scalar field."""
    real = kernels.runtime().real
    Values, Rows = (kernels.array_type(t) for t in (real, kernels.i32))
    qd, blocks = kernels.qd, lanes.reduction_blocks()
    reduced, share = lanes.REDUCED, blocks // lanes.REDUCED
    spread = 1 if serial else kernels.spread(blocks)
    huge = float(np.finfo(kernels.runtime().dtype).max) * (-1.0 if largest else 1.0)

    @kernels.kernel
    def extreme(field: Values, kind: Rows, partial: Values, result: Values, kinds: kernels.i32, count: kernels.i32):
        qd.loop_config(serialize=serial)
        for t in range(blocks * spread):
            if t % spread == 0:
                b = t // spread
                found = qd.cast(huge, real)
                for i in range(
                    qd.cast(qd.cast(count, qd.i64) * b // blocks, qd.i32),
                    qd.cast(qd.cast(count, qd.i64) * (b + 1) // blocks, qd.i32),
                ):
                    if kind[i] & kinds != 0:
                        if kernels.static(largest):
                            found = qd.max(found, field[i])
                        else:
                            found = qd.min(found, field[i])
                partial[b] = found
        qd.loop_config(serialize=serial)
        for c in range(reduced):
            found = qd.cast(huge, real)
            for k in range(share):
                if kernels.static(largest):
                    found = qd.max(found, partial[c + k * reduced])
                else:
                    found = qd.min(found, partial[c + k * reduced])
            result[c] = found

    return extreme
