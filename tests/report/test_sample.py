import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spume.report.particles import Overview, shown_ids
from spume.report.sample import even, extremes, rows_of, some_frames


def lattice(n, dimension):
    return np.stack(np.meshgrid(*[np.arange(n)] * dimension, indexing="ij"), axis=-1).reshape(-1, dimension) + 0.5


@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("count", [30, 500, 1000])
def test_the_sample_fills_the_same_space(dimension, count):
    n = {2: 60, 3: 20}[dimension]
    position = lattice(n, dimension)
    rows = even(position, 1.0, count)
    assert 0.3 * count < len(rows) <= count
    assert np.all(np.diff(rows) > 0)
    # No half of the space along any axis has much more than its half.
    for k in range(dimension):
        assert np.mean(position[rows, k] < n / 2) == pytest.approx(0.5, abs=0.15)
    # The nearest of them is nowhere far away.
    distance = (n**dimension / len(rows)) ** (1.0 / dimension)
    far = np.linalg.norm(position[:, None] - position[rows][None], axis=2).min(axis=1).max()
    assert far < 2.5 * distance


def test_few_rows_are_all_shown():
    assert list(even(lattice(3, 2), 1.0, 9)) == list(range(9))
    assert len(even(lattice(3, 2), 1.0, 0)) == 0


def test_many_more_rows_than_wanted():
    rows = even(lattice(200, 2), 1.0, 50)
    assert 15 < len(rows) <= 50


@given(st.integers(1, 400), st.integers(2, 60))
def test_frames_keep_first_and_last(count, largest):
    frames = some_frames(count, largest)
    assert (frames[0], frames[-1]) == (0, count - 1)
    assert len(frames) <= largest
    assert len(frames) == count or len(frames) == largest
    assert np.all(np.diff(frames) > 0)


def test_extremes_pass_over_what_is_not_finite():
    position = np.array([[0.0, 3.0], [1.0, 2.0], [5.0, -1.0]])
    found = extremes(position, {"pressure": np.array([np.nan, 2.0, 1.0]), "speed": np.full(3, np.nan)})
    assert found == {"x": (0, 2), "y": (2, 0), "pressure": (2, 1)}


@given(st.integers(0, 2**31), st.integers(1, 40), st.integers(50, 400), st.integers(0, 300))
def test_rows_with_extremes_are_always_shown(seed, few, rows, walls):
    random = np.random.default_rng(seed)
    ids = np.sort(random.choice(5000, rows, replace=False))
    seen = Overview(np.arange(1), np.zeros(1))
    seen.fluid_ids, seen.fluid_first = ids, random.uniform(0, 1, (rows, 2))
    seen.wall_ids, seen.wall_first = 5000 + np.arange(walls), random.uniform(0, 1, (walls, 2))
    seen.extreme_ids = np.sort(random.choice(ids, min(few, rows), replace=False))
    fluid, wall = shown_ids(seen, 0.01, 100)
    assert set(seen.extreme_ids) <= set(fluid) <= set(ids)
    assert set(wall) <= set(seen.wall_ids)
    assert len(fluid) + len(wall) <= 100
    assert (len(fluid), len(wall)) == (rows, walls) or rows + walls > 100


def test_rows_are_found_by_identity():
    find = rows_of(np.array([2, 5, 9]))
    rows, there = find(np.array([1, 5, 9, 12]))
    assert list(there) == [False, True, True, False]
    assert list(rows[there]) == [1, 2]
    assert not rows_of(np.zeros(0, dtype=np.int64))(np.array([1]))[1].any()
