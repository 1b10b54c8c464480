"""Neighbour lists against a brute-force search."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from arrangements import block, offsets, table
from conftest import initialized
from spume import kernels, lanes
from spume.pairs import Pairs
from spume.particles import DUMMY, FLUID, WALL, Particles
from spume.ranges import CELLS_PER_REACH

pytestmark = pytest.mark.usefixtures("runtime")

few = settings(
    max_examples=12, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.function_scoped_fixture]
)  # fmt: skip


def lists(particles, pairs):
    """Return the neighbours of each row as sets of ids, by id."""
    start, length = pairs.list.start.to_numpy(), pairs.list.length.to_numpy()
    neighbour, ids = pairs.list.chunks[0].neighbour.to_numpy(), particles.numpy("id")
    found = {}
    for i in range(particles.count):
        own = length[i] if i < particles.active else 0  # rows behind the active ones take no part
        entries = [int(ids[j]) for j in neighbour[lanes.slots(start[i : i + 1], [own])]]
        assert len(set(entries)) == len(entries), "a neighbour is listed twice"
        found[int(ids[i])] = set(entries)
    return found


def reach(pairs):
    """Return the distance [m] that the present list reaches; the skin adapts to how fast rows move."""
    assert pairs.list.current_skin in (0.0, pairs.list.skin)
    return pairs.list.radius + pairs.list.current_skin


def expected(particles, reach, period=None):
    """Return the neighbours of each row by brute force: dummies and walls that see no fluid have none."""
    ids, kind = particles.numpy("id"), particles.numpy("kind")
    near = np.linalg.norm(offsets(particles.numpy("position"), period), axis=-1) < reach
    np.fill_diagonal(near, False)
    near[kind == DUMMY] = False
    near[(kind == WALL) & ~(near & (kind == FLUID)).any(axis=1)] = False
    return {int(i): {int(j) for j in ids[row]} for i, row in zip(ids, near, strict=True)}


def mixed_kinds(rng, n):
    return rng.choice([FLUID, FLUID, WALL, DUMMY], n)


@few
@given(d=st.sampled_from([2, 3]), n=st.integers(1, 400), seed=st.integers(0, 2**32), clusters=st.booleans())
def test_random_and_clustered(d, n, seed, clusters):
    rng = np.random.default_rng(seed)
    position = rng.uniform(-1, 1, (n, d))
    if clusters:
        # Many rows a cell, and empty cells between: the list must grow.
        position = rng.uniform(-1, 1, (3, d))[rng.integers(0, 3, n)] + rng.normal(0, 0.06, (n, d))
    _, particles, pairs = table(position, kind=mixed_kinds(rng, n))
    assert lists(particles, pairs) == expected(particles, reach(pairs))


@few
@given(axes=st.integers(1, 7), d=st.sampled_from([2, 3]), n=st.integers(2, 350), seed=st.integers(0, 2**32))
def test_periodic(axes, d, n, seed):
    rng = np.random.default_rng(seed)
    periodic = [bool(axes >> k & 1) for k in range(d)]
    lengths = rng.uniform(0.691, 1.3, d)
    lower = rng.uniform(-2, 2, d)
    # Rows that have just left the period must come back on the other side.
    position = lower + rng.uniform(-0.2, 1.2, (n, d)) * lengths
    position[0] = lower - 1e-17
    region = (np.where(periodic, lower, -10), np.where(periodic, lower + lengths, 10))
    _, particles, pairs = table(position, region=region, periodic=periodic, kind=mixed_kinds(rng, n))
    period = np.where(periodic, lengths, np.inf)
    assert particles.count == n
    assert lists(particles, pairs) == expected(particles, reach(pairs), period)
    x = particles.numpy("position")
    assert np.all(x >= region[0])
    assert np.all(x <= region[1])


@few
@given(d=st.sampled_from([2, 3]), seed=st.integers(0, 2**32), far=st.sampled_from([3.0, 100.0, 1e4]))
def test_flying(d, seed, far):
    """Rows may fly far from where the calculation started, alone or as a group."""
    rng = np.random.default_rng(seed)
    position = rng.uniform(-0.5, 0.5, (150, d))
    _, particles, pairs = table(position, region=([-2e4] * d, [2e4] * d))
    flying = rng.choice(150, 30, replace=False)
    x = particles.numpy("position")
    x[flying[:20]] += far * rng.choice([-1.0, 1.0], d)
    x[flying[20:]] = rng.uniform(-far, far, (10, d))
    particles.set("position", x)
    assert pairs.update(particles) == 0
    assert lists(particles, pairs) == expected(particles, reach(pairs))


@pytest.mark.parametrize("d", [2, 3])
def test_rows_stand_in_cell_order_and_by_id_within_a_cell(d):
    rng = np.random.default_rng(3)
    reach = 0.23
    position = rng.uniform(0, 1, (300, d))
    _, particles, _ = table(position)
    x = particles.numpy("position")
    cell = np.floor((x - x.min(axis=0)) / (reach / np.array(CELLS_PER_REACH[:d]))).astype(int)
    key = [particles.numpy("id"), *[cell[:, k] for k in range(d)]]
    assert np.array_equal(np.lexsort(key), np.arange(300)), "x fastest, by id within a cell"
    assert np.array_equal(x, position[particles.numpy("id")]), "every field moves with its row"


def test_fluid_neighbours_come_first():
    rng = np.random.default_rng(4)
    kind = rng.choice([FLUID, FLUID, FLUID, WALL, DUMMY], 200)
    _, particles, pairs = table(rng.uniform(0, 2, (200, 2)), kind=kind)
    found, kind = pairs.list, particles.numpy("kind")
    start, length, fluid = (a.to_numpy() for a in (found.start, found.length, found.fluid))
    neighbour = found.chunks[0].neighbour.to_numpy()
    for row in range(particles.active):
        kinds = kind[neighbour[lanes.slots(start[row : row + 1], length[row : row + 1])]]
        assert np.all(kinds[: fluid[row]] == FLUID), "fluid first"
        assert not np.any(kinds[fluid[row] :] == FLUID), "then solid rows"
    assert np.any((fluid > 0) & (fluid < length))


def test_order_does_not_depend_on_the_order_before():
    position = np.random.default_rng(4).uniform(0, 1, (200, 2))
    shuffled = np.random.default_rng(5).permutation(200)
    _, one, _ = table(position)
    _, other, _ = table(position[shuffled], id=shuffled)
    assert np.array_equal(one.numpy("id"), other.numpy("id"))


@pytest.mark.parametrize("periodic", [None, [True, False]])
def test_the_skin_keeps_lists_valid(periodic):
    region = ([-0.5, -2.0], [0.5, 2.0])
    position = block(2, 10, disturbance=0.2)
    _, particles, pairs = table(position, region=region, periodic=periodic)
    rng = np.random.default_rng(6)
    # Just under half the skin: the list holds, and contains all that is nearer than the radius.
    direction = rng.normal(size=(100, 2))
    direction *= 0.0099 / np.linalg.norm(direction, axis=1, keepdims=True)
    particles.set("position", particles.numpy("position") + direction)
    pairs.update(particles)
    assert pairs.builds == 1
    found = lists(particles, pairs)
    near = expected(particles, 0.21, [1.0, np.inf] if periodic else None)
    assert all(near[i] <= found[i] for i in near)
    # One row just beyond it: built anew.
    x = particles.numpy("position")
    x[7, 0] += 0.02
    particles.set("position", x)
    pairs.update(particles)
    assert pairs.builds == 2
    assert lists(particles, pairs) == expected(particles, reach(pairs), [1.0, np.inf] if periodic else None)


def test_the_skin_is_dropped_where_rows_move_too_fast_for_it():
    _, particles, pairs = table(block(2, 8))
    step = np.array([0.009, 0.0])
    for _ in range(4):
        particles.set("position", particles.numpy("position") + step)
        pairs.update(particles)
    assert pairs.list.current_skin == 0.0
    assert lists(particles, pairs) == expected(particles, 0.21)
    for _ in range(6):
        particles.set("position", particles.numpy("position") + 0.01 * step)
        pairs.update(particles)
    assert pairs.list.current_skin == pairs.list.skin
    assert pairs.builds < 6, "in calm flow lists serve several updates again"


def test_without_a_skin_every_update_builds():
    _, particles, pairs = table(block(2, 5), skin=0.0)
    pairs.update(particles)
    assert pairs.builds == 2
    assert lists(particles, pairs) == expected(particles, 0.21)


def test_rows_outside_the_region_are_removed_and_counted():
    position = np.vstack([block(2, 6), [[5.0, 0.0], [0.0, -5.0], [7.0, 7.0]]])
    _, particles, pairs = table(position)
    assert particles.count == 39
    _, particles, pairs = table(position, region=([-10, -10], [10, 10]))
    pairs.list.upper = np.array([1.0, 1.0])
    pairs.list.lower = np.array([-1.0, -1.0])
    particles.changed = True
    assert pairs.update(particles) == 3
    assert sorted(particles.numpy("id")) == list(range(36))
    assert lists(particles, pairs) == expected(particles, reach(pairs))


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("periodic", [None, [True, True]])
def test_positions_that_are_no_numbers_are_removed(bad, periodic):
    _, particles, pairs = table(block(2, 9), region=([-0.45, -0.45], [0.45, 0.45]), skin=0.2, periodic=periodic)
    x = particles.numpy("position")
    x[13, 0] = bad
    x[57, 1] = bad
    gone = set(particles.numpy("id")[[13, 57]])
    particles.set("position", x)
    assert pairs.update(particles) == 2
    assert gone.isdisjoint(particles.numpy("id"))
    assert particles.count == 79
    period = None if periodic is None else [0.9, 0.9]
    assert lists(particles, pairs) == expected(particles, reach(pairs), period)


def test_an_overflowing_list_grows():
    _, particles, pairs = table(block(2, 12))
    before = pairs.list.bytes()
    particles.set("position", np.random.default_rng(2).uniform(-0.1, 0.1, (144, 2)))
    pairs.update(particles)
    assert pairs.list.bytes() > before
    assert lists(particles, pairs) == expected(particles, reach(pairs))
    assert sum(map(len, lists(particles, pairs).values())) > 144 * 100


@pytest.mark.parametrize("seed", range(10))
def test_a_list_that_just_fits_is_whole(seed):
    """Candidates are written before it is known whether they are near: the last of them may not hit the last slot."""
    _, particles, pairs = table(np.random.default_rng(seed).uniform(0.0, 0.6, (30, 2)))
    storage, length = pairs.list._storage, pairs.list.length.to_numpy()[: particles.active]
    whole = lists(particles, pairs)
    wide = kernels.runtime().wide
    storage.slots_per_block = int(length.max() * storage.rows_per_block if wide else length.sum())
    pairs.list.build(particles)
    assert lists(particles, pairs) == whole


@pytest.mark.parametrize("wide", ["", "1"])
def test_the_order_of_a_list_does_not_depend_on_the_room_for_it(wide, monkeypatch, device):
    """A run that goes on from a checkpoint may have more room or less; its sums must be the same bits."""
    monkeypatch.setenv("SPUME_WIDE", wide)
    kernels.initialize(device, 1, "double")
    rng = np.random.default_rng(3)
    kind = rng.choice([FLUID, WALL, DUMMY], 200)
    _, particles, pairs = table(rng.uniform(0.0, 1.5, (200, 2)), kind=kind)
    storage, found = pairs.list._storage, []
    longest = int(pairs.list.length.to_numpy()[: particles.active].max())
    for room in (longest, longest + 1, longest + 7, 3 * longest):
        storage.slots_per_block = room * storage.rows_per_block
        storage.blocks = 0
        pairs.list.build(particles)
        start, length = (a.to_numpy()[: particles.active] for a in (pairs.list.start, pairs.list.length))
        neighbour = pairs.list.chunks[0].neighbour.to_numpy()
        found.append(neighbour[lanes.slots(start, length)].tolist())
    assert len(found[0]) > 1000
    assert all(order == found[0] for order in found)


@few
@given(axes=st.integers(0, 7), d=st.sampled_from([2, 3]), seed=st.integers(0, 2**32))
def test_only_solid_rows_far_from_all_fluid_are_dry(axes, d, seed):
    rng = np.random.default_rng(seed)
    periodic = [bool(axes >> k & 1) for k in range(d)]
    lengths = np.full(d, 4.0)
    position = rng.uniform(0, 4.0, (600, d))
    kind = rng.choice([WALL, DUMMY], 600)
    kind[:3] = FLUID
    region = (np.where(periodic, 0.0, -10.0), np.where(periodic, lengths, 10.0))
    _, particles, pairs = table(position, region=region, periodic=periodic, kind=kind)
    x, kinds = particles.numpy("position"), particles.numpy("kind")
    period = np.where(periodic, lengths, np.inf)
    distance = np.linalg.norm(offsets(x, period), axis=-1)[:, kinds == FLUID].min(axis=1)
    active = np.arange(particles.count) < particles.active
    np.testing.assert_array_equal(particles.numpy("dry"), ~active)
    assert active[distance < 2.0 * reach(pairs)].all(), "a wall row that sees fluid must see all its neighbours"
    assert not active[distance > 6.0 * reach(pairs) * np.sqrt(d)].any(), "far rows must not cost anything"


def test_a_row_that_becomes_dry_loses_what_the_step_computed():
    position = np.array([[0.05, 0.05], [0.05, 0.15], [3.05, 0.05]])
    _, particles, pairs = table(position, spacing=0.1, kind=np.array([FLUID, WALL, WALL]))
    assert particles.active == 2
    particles.set("pressure", [7.0, 7.0, 0.0])
    x = particles.numpy("position")
    x[particles.numpy("kind") == FLUID] += [3.0, 0.1]
    particles.set("position", x)
    particles.changed = True
    pairs.update(particles)
    order = np.argsort(particles.numpy("id"))
    assert particles.active == 2
    np.testing.assert_array_equal(particles.numpy("dry")[order], [0, 1, 0])
    np.testing.assert_array_equal(particles.numpy("pressure")[order], [7.0, 0.0, 0.0])


def test_inserted_and_removed_rows():
    _, particles, pairs = table(block(2, 6))
    rows = {"position": block(2, 30, seed=9) + 0.05, "kind": np.full(900, FLUID)}
    particles.insert(rows)
    pairs.update(particles)
    assert lists(particles, pairs) == expected(particles, reach(pairs))
    particles.remove(particles.numpy("id") % 3 == 0)
    pairs.update(particles)
    assert particles.count == 624
    assert lists(particles, pairs) == expected(particles, reach(pairs))


@pytest.mark.filterwarnings("error")
def test_a_table_that_lost_every_row():
    _, particles, pairs = table(block(2, 4), region=([-1, -1], [1, 1]))
    particles.set("position", particles.numpy("position") + 5.0)
    assert pairs.update(particles) == 16
    assert particles.count == 0
    assert pairs.update(particles) == 0


def test_a_period_too_short_is_refused():
    with pytest.raises(ValueError, match="axis 0: at least three times the search radius"):
        table(block(2, 5), region=([-0.3, -1.0], [0.3, 1.0]), periodic=[True, False])


@pytest.mark.parametrize(("lower", "upper"), [(0.0, 0.3), (-0.3, 0.3), (0.0, 20.0)])
@pytest.mark.parametrize("precision", ["single", "double"])
def test_no_row_is_lost_at_a_periodic_boundary(device, precision, lower, upper):
    """However rounding falls where it crosses; what is no number is removed there, too."""
    initialized(device, 1, precision)
    for lost in (0, 1):  # removing a row makes the others be brought back once more
        x = np.array([lower - 1e-9, lower - 2e-8, lower, upper, upper + 1e-8, np.float32(upper), 0.1, *[np.nan] * lost])
        particles = Particles(2, 0.1, (), capacity=len(x))
        particles.insert({"position": np.stack([x, np.full(len(x), 0.1)], -1), "kind": np.full(len(x), FLUID)})
        pairs = Pairs(0.05, 0.02, [lower, 0.0], [upper, 1.0], [True, False])
        assert pairs.update(particles) == lost
        assert particles.count == 7
        found = particles.numpy("position")[:, 0]
        real = kernels.runtime().dtype
        assert np.all((found >= real(lower)) & (found < real(upper))), "the upper end is the lower one"
