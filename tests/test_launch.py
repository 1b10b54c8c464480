"""Launching kernels by what their first call found out."""

from dataclasses import dataclass

import numpy as np
import pytest

from spume import kernels
from spume.launch import _planned


@pytest.fixture
def scaled(device):
    kernels.initialize(device)
    Vectors, Rows = kernels.array_type(kernels.vector(2)), kernels.array_type(kernels.i32)
    real = kernels.runtime().real

    @kernels.kernel
    def scaled(x: Vectors, add: Rows, factor: real, out: Vectors, offset: kernels.i32, count: kernels.i32):
        for i in range(count):
            out[i] = factor * x[i] + kernels.qd.cast(add[i] + offset, real)

    return scaled


def made(values, kind):
    array = kernels.array(kind, len(values))
    content = kernels.host(array)
    content[:] = values
    kernels.publish(array, content)
    return array


def test_later_calls_see_their_own_arrays_and_numbers(scaled):
    for call, (count, factor, offset) in enumerate([(3, 2.0, 0), (5, np.float64(-0.5), np.int64(7)), (4, 3, -1)]):
        x, add = np.arange(2.0 * count).reshape(-1, 2) + call, np.arange(count) - call
        out = made(np.zeros((count, 2)), kernels.vector(2))
        scaled(made(x, kernels.vector(2)), made(add, kernels.i32), factor, out, offset, count)
        assert kernels.host(out) == pytest.approx(factor * x + (add + offset)[:, None], rel=1e-6)


def test_a_kernel_that_returns_a_number_returns_it_each_time(device):
    kernels.initialize(device)
    Rows = kernels.array_type(kernels.i32)

    @kernels.kernel
    def last(values: Rows, i: kernels.i32) -> kernels.i32:
        return values[i]

    values = made([4, 5, 6], kernels.i32)
    assert [last(values, i) for i in (2, 0, 1)] == [6, 4, 5]


def test_a_struct_of_arrays_is_no_array(device):
    kernels.initialize(device)

    @dataclass
    class Both:
        a: kernels.array_type(kernels.i32)
        b: kernels.array_type(kernels.i32)

    @kernels.kernel
    def exchanged(both: Both, count: kernels.i32):
        for i in range(count):
            kept = both.a[i]
            both.a[i] = both.b[i]
            both.b[i] = kept

    for _ in range(3):
        a, b = made([1, 2], kernels.i32), made([3, 4], kernels.i32)
        exchanged(Both(a, b), 2)
        assert list(kernels.host(a)) == [3, 4]
        assert list(kernels.host(b)) == [1, 2]


def test_what_cannot_be_planned_is_called_as_it_is():
    assert _planned(len, kernels.qd) is None


def test_arrays_and_numbers_are_planned(device):
    kernels.initialize(device)
    Rows = kernels.array_type(kernels.i32)

    @kernels.qd.kernel
    def counted(values: Rows, count: kernels.i32):
        for i in range(count):
            values[i] = i

    assert _planned(counted, kernels.qd) is None  # not before its first call
    values = made([0, 0, 0], kernels.i32)
    counted(values, 2)
    _planned(counted, kernels.qd)(values, 3)
    assert list(kernels.host(values)) == [0, 1, 2]


def test_of_a_struct_those_members_are_handed_over_that_the_kernel_uses(device):
    kernels.initialize(device)
    Rows, i32 = kernels.array_type(kernels.i32), kernels.i32

    @dataclass
    class Table:
        unused: Rows
        values: Rows
        offset: i32
        other: Rows
        unused_too: Rows

    @kernels.qd.kernel
    def added(first: i32, table: Table, again: Table, out: Rows, count: i32):
        for i in range(count):
            out[i] = first + table.values[i] + table.offset + again.other[i]

    def table(values, offset, other):
        return Table(made([-1], i32), made(values, i32), offset, made(other, i32), made([-1], i32))

    out = made([0, 0], i32)
    added(100, table([1, 2], 10, [7, 7]), table([8, 8], 9, [3, 4]), out, 2)
    assert list(kernels.host(out)) == [114, 116]
    launch = _planned(added, kernels.qd)
    launch(200, table([5, 6], 20, [7, 7]), table([8, 8], 9, [30, 40]), out, 2)
    assert list(kernels.host(out)) == [255, 266]


def test_a_struct_in_a_struct_is_called_as_the_language_does(device):
    kernels.initialize(device)
    Rows, i32 = kernels.array_type(kernels.i32), kernels.i32

    @dataclass
    class Inner:
        values: Rows

    @dataclass
    class Outer:
        inner: Inner
        more: Rows

    @kernels.qd.kernel
    def copied(outer: Outer, count: i32):
        for i in range(count):
            outer.more[i] = outer.inner.values[i]

    more = made([0, 0], i32)
    copied(Outer(Inner(made([3, 4], i32)), more), 2)
    assert list(kernels.host(more)) == [3, 4]
    assert _planned(copied, kernels.qd) is None
