"""Loops of devices that run thousands of short threads: one row each, sums in stages, lists that lie interleaved.

A processor works on a few long blocks of rows. On a graphics card (``Runtime.wide``) a block is one row, so that
threads beside each other read rows beside each other. Three things follow, and stand here: partial sums of one row
each are folded in several loops, exclusive sums are made in several loops, and the lists of ``GROUP`` rows lie
interleaved: slot k of all of them, then slot k + 1 (the sliced format of Monakov, Lokhmotov & Avetisyan 2010).

Functions that contain loops are called at the top of a kernel, where each of their loops is a task of its own.
"""

from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume import kernels

GROUP = 32
"""Rows whose lists lie interleaved on wide devices: as many as threads that load together."""

REDUCED = 128
"""Numbers that are left of a sum or an extreme over rows, to be taken together by the processor."""

_FOLDS = (1 << 16, 1 << 10, 1 << 5)
"""Partial sums that are left after each loop that folds them."""


def stride() -> int:
    """Return by how many slots two neighbours of a row lie apart."""
    return GROUP if kernels.runtime().wide else 1


def slots(start: NDArray[np.integer], length: NDArray[np.integer]) -> NDArray[np.int64]:
    """Return the slots of the lists of rows, one row's after another's.

    Args:
        start, length: first slot and number of entries of each row, shape (rows,).
    """
    length = np.asarray(length, np.int64)
    before = np.cumsum(length) - length
    within = np.arange(length.sum()) - np.repeat(before, length)
    return np.repeat(np.asarray(start, np.int64)[: len(length)], length) + within * stride()


def reduction_blocks() -> int:
    """Return into how many parts an extreme or a sum over rows is cut, a multiple of ``REDUCED``."""
    return 1 << 16 if kernels.runtime().wide else REDUCED


def room_for_sums(rows: int, parts: int) -> int:
    """Return how many partial sums there must be room for: ``parts``, on wide devices one for each row."""
    return max(rows, _FOLDS[0]) if kernels.runtime().wide else parts


def room_for_scan(n: int) -> int:
    """Return the size of the array in which `exclusive_sums` of n counts puts sums of parts."""
    if not kernels.runtime().wide:
        return _PARTS
    return max(sum(-(-n // step) for step in _STAGES), 1)


_PARTS = 1 << 8
_STAGES = (1 << 4, 1 << 8, 1 << 13, 1 << 18)
"""Counts whose sum a thread leaves in each stage of an exclusive sum on wide devices.

What a thread sums lies together. Many threads with many counts each would crowd each other out of the cache.
"""


@kernels.cached
def parts_of() -> Any:
    """Return the functions that cut rows into parts.

    * ``every(parts, n)``: the number of parts of n rows, ``parts`` or n;
    * ``row(b, parts, n)``: the first row of part b of ``every(parts, n)``, or of 1;
    * ``bound(b, parts, n)``: the first row of part b of ``parts``, also on wide devices.
    """
    qd, i32, i64, wide = kernels.qd, kernels.i32, kernels.i64, kernels.runtime().wide

    @kernels.func
    def every(parts: i32, n: i32):  # type: ignore[no-untyped-def, valid-type]
        found = parts
        if kernels.static(wide):
            found = n
        return found

    @kernels.func
    def bound(b: i32, parts: i32, n: i32):  # type: ignore[no-untyped-def, valid-type]
        return qd.cast(qd.cast(n, i64) * b // parts, i32)

    @kernels.func
    def row(b: i32, parts: i32, n: i32):  # type: ignore[no-untyped-def, valid-type]
        # Without a division where a part is a row.
        found = b
        if kernels.static(wide):
            if parts == 1:
                found = b * n
        else:
            found = bound(b, parts, n)
        return found

    return SimpleNamespace(every=every, bound=bound, row=row)


@kernels.cached
def fold(width: int = 3) -> Any:
    """Return the function ``fold(partial, n)``, which leaves few of n partial sums of ``width`` numbers each.

    ``total(partial, parts, which)`` of the same namespace sums what is left, in one thread: ``parts`` of them, or on
    wide devices those of the last fold.
    """
    qd, i32, wide = kernels.qd, kernels.i32, kernels.runtime().wide
    real = kernels.runtime().real
    Reals = kernels.array_type(real)
    first, second, third = _FOLDS

    @kernels.func
    def together(partial: Reals, t: i32, n: i32, lanes: i32):  # type: ignore[no-untyped-def, valid-type]
        for which in kernels.static(range(width)):
            s = qd.cast(0, real)
            for k in range((n - t + lanes - 1) // lanes):
                s += partial[width * (t + k * lanes) + which]
            partial[width * t + which] = s

    @kernels.func
    def folded(partial: Reals, n: i32):  # type: ignore[no-untyped-def, valid-type]
        if kernels.static(wide):
            for t in range(first):
                together(partial, t, n, first)
            for t in range(second):
                together(partial, t, first, second)
            for t in range(third):
                together(partial, t, second, third)

    @kernels.func
    def total(partial: Reals, parts: i32, which: i32):  # type: ignore[no-untyped-def, valid-type]
        s = qd.cast(0, real)
        if kernels.static(wide):
            for b in range(third):
                s += partial[width * b + which]
        else:
            for b in range(parts):
                s += partial[width * b + which]
        return s

    return SimpleNamespace(fold=folded, total=total)


@kernels.cached
def exclusive_sums(serial: bool = False) -> Any:
    """Return the function ``scan(counts, start, sums, n)`` of exclusive sums, made by many threads or by one.

    ``start[n]`` is their total; ``counts`` end up equal to ``start``, to serve as cursors. ``sums`` has
    `room_for_scan` numbers.
    """
    return _sums_in_stages() if kernels.runtime().wide else _sums_by_parts(serial)


def _sums_by_parts(serial: bool) -> Any:
    qd, i32 = kernels.qd, kernels.i32
    Rows, parts = kernels.array_type(i32), _PARTS
    spread = 1 if serial else kernels.spread(parts)

    @kernels.func
    def scan(counts: Rows, start: Rows, sums: Rows, n: i32):  # type: ignore[no-untyped-def, valid-type]
        qd.loop_config(serialize=serial)
        for t in range(parts * spread):
            if t % spread == 0:
                b = t // spread
                size = (n + parts - 1) // parts
                total = 0
                for c in range(qd.min(b * size, n), qd.min((b + 1) * size, n)):
                    total += counts[c]
                sums[b] = total
        qd.loop_config(serialize=True)
        for _ in range(1):
            total = 0
            for b in range(parts):
                own = sums[b]
                sums[b] = total
                total += own
            start[n] = total
        qd.loop_config(serialize=serial)
        for t in range(parts * spread):
            if t % spread == 0:
                b = t // spread
                size = (n + parts - 1) // parts
                total = sums[b]
                for c in range(qd.min(b * size, n), qd.min((b + 1) * size, n)):
                    own = counts[c]
                    start[c] = total
                    counts[c] = total
                    total += own

    return scan


def _sums_in_stages() -> Any:
    qd, i32, stages = kernels.qd, kernels.i32, _STAGES
    Rows = kernels.array_type(i32)
    # Of each stage behind the first: the steps of the stages before it, its own, and how many sums it takes together.
    further = tuple((stages[:k], stages[k], stages[k] // stages[k - 1]) for k in range(1, len(stages)))
    first, before_last, last = stages[0], stages[:-1], stages[-1]

    @kernels.func
    def behind(n: i32, steps: kernels.qd.template()):  # type: ignore[no-untyped-def, valid-type]
        """Return where the sums behind the stages of these steps begin."""
        at = 0
        for step in kernels.static(steps):
            at += (n + step - 1) // step
        return at

    @kernels.func
    def scan(counts: Rows, start: Rows, sums: Rows, n: i32):  # type: ignore[no-untyped-def, valid-type]
        for b in range((n + first - 1) // first):
            total = 0
            for c in range(b * first, qd.min((b + 1) * first, n)):
                total += counts[c]
            sums[b] = total
        for finer, step, share in kernels.static(further):
            for b in range((n + step - 1) // step):
                source = behind(n, finer[:-1])
                end = behind(n, finer)
                total = 0
                for c in range(source + b * share, qd.min(source + (b + 1) * share, end)):
                    total += sums[c]
                sums[end + b] = total
        qd.loop_config(serialize=True)
        for _ in range(1):
            source = behind(n, before_last)
            total = 0
            for c in range(source, source + (n + last - 1) // last):
                own = sums[c]
                sums[c] = total
                total += own
            start[n] = total
        for finer, step, share in kernels.static(further[::-1]):
            for b in range((n + step - 1) // step):
                source = behind(n, finer[:-1])
                end = behind(n, finer)
                total = sums[end + b]
                for c in range(source + b * share, qd.min(source + (b + 1) * share, end)):
                    own = sums[c]
                    sums[c] = total
                    total += own
        for b in range((n + first - 1) // first):
            total = sums[b]
            for c in range(b * first, qd.min((b + 1) * first, n)):
                own = counts[c]
                start[c] = total
                counts[c] = total
                total += own

    return scan
