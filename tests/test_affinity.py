"""Where the threads of the pool run: one group of processors each, which the system says they keep to."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from conftest import initialized
from spume import affinity, kernels


@given(st.sets(st.integers(0, 300), min_size=1, max_size=40), st.integers(1, 50))
def test_groups_share_all_processors_out(processors, number):
    found = affinity.groups(sorted(processors), number)
    assert len(found) == number
    assert set().union(*found) == processors
    sizes = [len(group) for group in found]
    assert min(sizes) >= 1
    assert max(sizes) - min(sizes) <= 1
    if number <= len(processors):
        assert sum(sizes) == len(processors)


def described(folder: Path, cores: dict[int, tuple[int, int]]) -> Path:
    for processor, (socket, core) in cores.items():
        topology = folder / f"cpu{processor}" / "topology"
        topology.mkdir(parents=True)
        (topology / "physical_package_id").write_text(f"{socket}\n")
        (topology / "core_id").write_text(f"{core}\n")
    return folder


def test_two_threads_of_a_core_stand_beside_each_other(tmp_path):
    # Two sockets of two cores with two threads each, numbered as Linux does: 4 to 7 are the second threads of 0 to 3.
    cores = {0: (0, 0), 1: (0, 1), 2: (1, 0), 3: (1, 1), 4: (0, 0), 5: (0, 1), 6: (1, 0), 7: (1, 1)}
    order = affinity.by_core(set(cores), described(tmp_path, cores))
    assert order == [0, 4, 1, 5, 2, 6, 3, 7]
    assert affinity.groups(order, 4) == [[0, 4], [1, 5], [2, 6], [3, 7]]


def test_processors_without_a_description_stand_in_order(tmp_path):
    assert affinity.by_core({3, 1, 2}, tmp_path) == [1, 2, 3]


@pytest.fixture
def pool(monkeypatch):
    """A pool of two threads that do not exist, on processors 0 and 1; ``places`` and ``times`` are what it sees."""
    monkeypatch.setattr(affinity, "threads_of_process", lambda: frozenset({10, 11, 12}))
    monkeypatch.setattr(affinity, "by_core", lambda processors, topology: sorted(processors))
    monkeypatch.setattr(os, "sched_getaffinity", lambda thread: {0, 1}, raising=False)
    places: dict[int, list[int]] = {}
    monkeypatch.setattr(os, "sched_setaffinity", lambda t, place: places.__setitem__(t, list(place)), raising=False)
    times = [0, 0]
    monkeypatch.setattr(affinity, "times_of", lambda threads: tuple(times))
    made = affinity.Pool(frozenset({10}), 2)
    made.review(100.0)
    return made, places, times


def test_threads_that_wait_are_let_go_and_settled_again(pool):
    made, places, times = pool
    assert places == {11: [0], 12: [1]}
    times[:] = [1_900_000_000, 100_000_000]
    made.review(101.5)
    assert made.settled, "a twentieth of the time is nothing"
    times[:] = [2_900_000_000, 1_100_000_000]
    made.review(101.9)
    assert made.settled, "looked at too soon"
    made.review(103.0)
    assert not made.settled
    assert places == {11: [0, 1], 12: [0, 1]}
    times[:] = [2_950_000_000, 1_150_000_000]
    made.review(120.0)
    assert not made.settled
    made.review(123.5)
    assert made.settled
    assert places == {11: [0], 12: [1]}


def test_threads_that_hardly_ran_stay(pool):
    made, _, times = pool
    times[:] = [10_000_000, 50_000_000]
    made.review(102.0)
    assert made.settled


def test_a_pool_of_one_thread_and_one_that_is_not_found_are_left_alone(monkeypatch):
    monkeypatch.setattr(affinity, "threads_of_process", lambda: frozenset({10, 11}))
    monkeypatch.setattr(os, "sched_setaffinity", lambda *_: pytest.fail("placed"), raising=False)
    for made in (affinity.Pool(frozenset({10}), 1), affinity.Pool(frozenset({10}), 2)):
        assert made.threads == ()
        made.review(1.0)
        made.review(1e6)


def time_on_processors() -> dict[int, int]:
    """Return for how long [ns] each thread of this process has run."""
    tasks = Path("/proc/self/task")
    return {int(t.name): int((t / "schedstat").read_text().split()[0]) for t in tasks.iterdir()}


@pytest.mark.skipif(not Path("/proc/self/schedstat").exists(), reason="the system does not say how long threads ran")
@pytest.mark.skipif(kernels.processors() < 2, reason="one processor")
def test_the_threads_that_work_have_processors_of_their_own(device):
    if device != "cpu":
        pytest.skip("about processors")
    initialized("cpu", 1, "double")
    free = os.sched_getaffinity(0)
    initialized("cpu", 2, "double")
    qd, Reals = kernels.qd, kernels.array_type(kernels.runtime().real)

    @kernels.kernel
    def work(a: Reals, count: kernels.i32):
        for i in range(count):
            for _ in range(1000):
                a[i] = qd.sqrt(a[i] + 1.0)

    numbers = kernels.array(kernels.runtime().real, 20_000)
    work(numbers, 20_000)
    kernels.wait()
    before = time_on_processors()
    worked: set[int] = set()
    for _ in range(50):  # on a busy machine one of them may be late for many loops
        work(numbers, 20_000)
        kernels.wait()
        worked = {t for t, ran in time_on_processors().items() if ran - before.get(t, 0) > 1e6 and t != os.getpid()}
        if len(worked) == 2:
            break
    assert kernels._pool is not None
    assert worked == set(kernels._pool.threads)
    places = [os.sched_getaffinity(t) for t in worked]
    assert places[0].isdisjoint(places[1])
    assert places[0] | places[1] == free == os.sched_getaffinity(0)
    assert np.all(np.isfinite(kernels.host(numbers)))
