"""Threads that go through stages together: every part once, no stage before the one before it is done, and an end."""

import numpy as np
import pytest

from conftest import initialized
from spume import kernels, team

STAGES = 40


@pytest.fixture
def two_threads(device):
    if device != "cpu":
        pytest.skip("about threads of a processor")
    return initialized("cpu", 2, "double")


def relay(one_after_another: bool):
    """Return the kernel that in each stage adds to every number what its right-hand neighbour was before.

    Args:
        one_after_another: whether the second thread of the team sets out when the first has come to the end.
    """
    qd, i32 = kernels.qd, kernels.i32
    Numbers, Counts = kernels.array_type(kernels.i64), kernels.array_type(i32)
    Board, together = team.board_type(), team.calls()
    threads, end, stages = kernels.runtime().threads, team.END, STAGES
    spread = kernels.spread(threads)

    @kernels.kernel
    def pass_on(a: Numbers, b: Numbers, done: Counts, decided: Counts, board: Board, n: i32, parts: i32):
        qd.loop_config(serialize=True)
        for _ in range(1):
            together.gather(board)
        qd.loop_config(serialize=one_after_another)
        for t in range(threads * spread):
            at = 0 if t % spread == 0 else end
            while at < end:
                taken = together.take(board)
                at = together.stage(taken)
                part = together.part(taken)
                if at < end:
                    if part >= parts:
                        together.wait(board, at)
                    else:
                        for i in range(n * part // parts, n * (part + 1) // parts):
                            if at % 2 == 0:
                                b[i] = a[i] + a[(i + 1) % n]
                            else:
                                a[i] = b[i] + b[(i + 1) % n]
                        done[at * parts + part] += 1
                        if together.last(board, parts) == 1:
                            decided[at] += 1
                            together.open(board, at + 1 if at + 1 < stages else end)

    return pass_on


@pytest.mark.parametrize("one_after_another", [False, True])
@pytest.mark.parametrize(("n", "parts"), [(1, 1), (7, 3), (64, 2), (1000, 5), (20_000, 8)])
def test_every_stage_finds_the_one_before_it_done(two_threads, n, parts, one_after_another):
    kernel = relay(one_after_another)
    a, b = kernels.array(kernels.i64, n), kernels.array(kernels.i64, n)
    begin = np.random.default_rng(n).integers(0, 1000, n)
    board = team.board()
    for _ in range(5):
        expected = begin.astype(np.int64)
        done, decided = kernels.array(kernels.i32, STAGES * parts), kernels.array(kernels.i32, STAGES)
        a.from_numpy(begin.astype(np.int64))
        kernel(a, b, done, decided, board, n, parts)
        for _ in range(STAGES):
            expected = expected + np.roll(expected, -1)  # wraps around 2^63 in both
        assert np.array_equal(kernels.host(a), expected)
        assert np.all(kernels.host(done) == 1)
        assert np.all(kernels.host(decided) == 1)
