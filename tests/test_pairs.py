"""Sums, minima and maxima over pairs, against plain NumPy."""

import numpy as np
import pytest

from arrangements import block, offsets, table, weights
from spume import kernels
from spume.marks import pair_mark
from spume.pairs import (
    PairSum,
    PairView,
    pair_max,
    pair_min,
    pair_sum,
    pair_sums,
    pair_term,
    row_map,
    row_term,
)
from spume.particles import DUMMY, FLUID, WALL
from spume.schemes.weight.inverse import Inverse
from spume.schemes.weight.quadratic import Quadratic

W = Inverse()


@pair_term(reads=("scalar",))
def difference(a, b, r, w):
    return w * (b.scalar - a.scalar)


@pair_term()
def plain(a, b, r, w):
    return w


@pair_term(reads=("scalar", "whole"), shape=("d",))
def flow(a, b, r, w):
    return w * b.scalar * r + a.whole * r


@pair_term(shape=("d", "d"))
def square(a, b, r, w):
    return w * r.outer_product(r)


@pair_term(reads=("scalar",))
def value(a, b, r, w):
    return b.scalar


@pair_term(reads=("whole",))
def whole_value(a, b, r, w):
    return b.whole


def filled(d, periodic=False, seed=0):
    """Return a disturbed block with random fields, and r_ij, W_ij and fields in row order."""
    cells = 9 if d == 2 else 7
    half = cells * 0.05
    region = ([-half] * d, [half] * d) if periodic else None
    position = block(d, cells, disturbance=0.3, seed=seed)
    rng = np.random.default_rng(seed)
    n = len(position)
    _, particles, pairs = table(
        position, region=region, periodic=[periodic] * d, skin=0.2 if d == 2 else 0.1,
        scalar=rng.normal(size=n), whole=rng.integers(-5, 5, n), kind=rng.choice([FLUID, WALL, DUMMY], n),
    )  # fmt: skip
    r = offsets(particles.numpy("position"), [2 * half] * d if periodic else None)
    return particles, pairs, r, weights(r, W, 0.21)


def close(runtime):
    return {"rel": 1e-11, "abs": 1e-12} if runtime.precision == "double" else {"rel": 1e-4, "abs": 1e-4}


@pytest.mark.parametrize("periodic", [False, True], ids=["open", "periodic"])
@pytest.mark.parametrize("d", [2, 3])
def test_sums_of_several_terms_in_one_pass(every_runtime, d, periodic):
    particles, pairs, r, w = filled(d, periodic)
    s, whole, kind = particles.numpy("scalar"), particles.numpy("whole"), particles.numpy("kind")
    outs = ("answer", "answer_2", "vector", "tensor")
    pair_sum((difference, plain, flow, square), particles, pairs, out=outs, weight=W, re=0.21)
    fluid = kind == FLUID
    near = (w > 0)[..., None]
    assert particles.numpy("answer")[fluid] == pytest.approx(
        (w * (s[None, :] - s[:, None])).sum(axis=1)[fluid], **close(every_runtime)
    )
    assert particles.numpy("answer_2")[fluid] == pytest.approx(w.sum(axis=1)[fluid], **close(every_runtime))
    vector = (w[..., None] * s[None, :, None] * r + whole[:, None, None] * r * near).sum(axis=1)
    assert particles.numpy("vector")[fluid] == pytest.approx(vector[fluid], **close(every_runtime))
    tensor = np.einsum("ij,ijk,ijl->ikl", w, r, r)
    assert particles.numpy("tensor")[fluid] == pytest.approx(tensor[fluid], **close(every_runtime))
    for name in outs:
        assert not particles.numpy(name)[~fluid].any(), "rows of other kinds keep their values"


@pytest.mark.parametrize("d", [2, 3])
def test_sums_of_different_rows_weights_and_radii_in_one_pass(every_runtime, d):
    particles, pairs, r, _ = filled(d)
    kind, s = particles.numpy("kind"), particles.numpy("scalar")
    asked = (
        PairSum((plain,), ("answer",), W, 0.21, rows=FLUID | WALL),
        PairSum((difference, flow), ("answer_2", "vector"), Quadratic(), 0.17, over=FLUID),
        PairSum((square,), ("tensor",), W, 0.21, rows=WALL | DUMMY, over=WALL | DUMMY),
    )
    pair_sums(asked, particles, pairs)
    w, v = weights(r, W, 0.21), weights(r, Quadratic(), 0.17) * ((kind & FLUID) != 0)
    expected = {
        "answer": w.sum(axis=1) * ((kind & (FLUID | WALL)) != 0),
        "answer_2": (v * (s[None, :] - s[:, None])).sum(axis=1) * (kind == FLUID),
        "tensor": np.einsum("ij,ijk,ijl->ikl", w * (kind != FLUID), r, r) * (kind != FLUID)[:, None, None],
    }
    for name, values in expected.items():
        listed = kind != DUMMY  # dummy rows have no list
        assert particles.numpy(name)[listed] == pytest.approx(values[listed], **close(every_runtime)), name


@pytest.mark.parametrize("periodic", [False, True], ids=["open", "periodic"])
@pytest.mark.parametrize("d", [2, 3])
def test_sums_over_a_radius_that_hardly_a_row_has_a_neighbour_within(every_runtime, d, periodic):
    particles, pairs, r, _ = filled(d, periodic)
    s, fluid = particles.numpy("scalar"), particles.numpy("kind") == FLUID
    w = weights(r, W, 0.062)
    few = (w[fluid] > 0).any(axis=1)
    assert few.any()
    assert not few.all()
    pair_sum((difference, plain), particles, pairs, out=("answer", "answer_2"), weight=W, re=0.062)
    assert particles.numpy("answer")[fluid] == pytest.approx(
        (w * (s[None, :] - s[:, None])).sum(axis=1)[fluid], **close(every_runtime)
    )
    assert particles.numpy("answer_2")[fluid] == pytest.approx(w.sum(axis=1)[fluid], **close(every_runtime))


@pytest.mark.parametrize("periodic", [False, True], ids=["open", "periodic"])
@pytest.mark.parametrize("d", [2, 3])
def test_rows_near_marked_ones(every_runtime, d, periodic):
    particles, pairs, r, _ = filled(d, periodic, seed=3)
    fluid = particles.numpy("kind") == FLUID
    chosen = np.flatnonzero(fluid)[:3]
    positive = np.full(particles.count, -1.0)
    positive[chosen] = [0.5, 1.0, 1e-9]
    positive[~fluid] = 1.0
    particles.set("scalar", positive)
    particles.set("answer", np.zeros(particles.count))
    pair_mark("scalar", particles, pairs, out="answer")
    distance = np.linalg.norm(r, axis=2)[:, chosen].min(axis=1)
    reach = pairs.list.radius + pairs.list.current_skin
    assert set(np.unique(particles.numpy("answer"))) == {0.0, 1.0}
    np.testing.assert_array_equal(particles.numpy("answer") == 1.0, distance < reach)


def test_sums_are_kept_until_something_they_depend_on_changes(runtime):
    particles, pairs, _, _ = filled(2)
    first, second = PairSum((plain,), ("answer",), W, 0.21), PairSum((difference,), ("answer_2",), W, 0.21)

    def made(*asked):
        """How many passes it takes."""
        before = particles.visits
        pair_sums(asked, particles, pairs)
        return particles.visits - before

    assert made(first, second) == 1
    assert made(second) == made(first) == made(first, second) == 0
    assert made(PairSum((plain,), ("answer",), W, 0.2)) == made(first) == 1
    particles.set("scalar", 2.0 * particles.numpy("scalar"))
    assert made(first) == 0
    assert made(first, second) == 1
    particles.set("position", 1.01 * particles.numpy("position"))
    assert made(second) == made(first) == 1


def test_rows_that_a_field_leaves_out(runtime):
    particles, pairs, _, w = filled(2)
    chosen = (particles.numpy("scalar") > 0) & (particles.numpy("kind") == FLUID)
    particles.set("answer", np.full(particles.count, -7.0))
    pair_sum(plain, particles, pairs, out="answer", weight=W, re=0.21, where="scalar")
    assert particles.numpy("answer")[chosen] == pytest.approx(w.sum(axis=1)[chosen], rel=1e-11)
    assert np.all(particles.numpy("answer")[~chosen] == -7.0)
    particles.set("answer", np.full(particles.count, -7.0))
    pair_max(plain, particles, pairs, out="answer", weight=W, re=0.21, where="scalar")
    assert particles.numpy("answer")[chosen] == pytest.approx(w.max(axis=1)[chosen], rel=1e-11)
    assert np.all(particles.numpy("answer")[~chosen] == -7.0)


@pytest.mark.parametrize("d", [2, 3])
def test_minimum_and_maximum(every_runtime, d):
    particles, pairs, _, w = filled(d)
    s, fluid = particles.numpy("scalar"), particles.numpy("kind") == FLUID
    pair_min(value, particles, pairs, out="answer", weight=W, re=0.21)
    pair_max(value, particles, pairs, out="answer_2", weight=W, re=0.21)
    low = np.where(w > 0, s[None, :], np.inf).min(axis=1)
    high = np.where(w > 0, s[None, :], -np.inf).max(axis=1)
    assert np.array_equal(particles.numpy("answer")[fluid], low[fluid])
    assert np.array_equal(particles.numpy("answer_2")[fluid], high[fluid])


def test_minimum_and_maximum_of_a_lone_row(every_runtime):
    _, particles, pairs = table([[0.0, 0.0], [5.0, 5.0]])
    pair_min(value, particles, pairs, out="answer", weight=W, re=0.21)
    pair_max(value, particles, pairs, out="answer_2", weight=W, re=0.21)
    largest = np.finfo(every_runtime.dtype).max
    assert np.all(particles.numpy("answer") >= largest)
    assert np.all(particles.numpy("answer_2") <= -largest)


@pytest.mark.parametrize("over", [FLUID, WALL, FLUID | DUMMY])
@pytest.mark.parametrize("rows", [FLUID, WALL, FLUID | WALL])
def test_kinds_that_sum_and_that_are_summed_over(runtime, rows, over):
    particles, pairs, _, w = filled(2)
    kind = particles.numpy("kind")
    particles.set("answer", np.full(particles.count, -7.0))
    pair_sum(plain, particles, pairs, out="answer", weight=W, re=0.21, rows=rows, over=over)
    sums = np.where(kind[None, :] & over, w, 0.0).sum(axis=1)
    answer = particles.numpy("answer")
    chosen = (kind & rows) != 0
    # A wall row that sees no fluid within radius and skin has no list; here every one does.
    assert answer[chosen] == pytest.approx(sums[chosen], rel=1e-11, abs=1e-13)
    assert np.all(answer[~chosen] == -7.0)


def test_a_smaller_radius_than_the_list(runtime):
    particles, pairs, r, _ = filled(2)
    fluid = particles.numpy("kind") == FLUID
    pair_sum(plain, particles, pairs, out="answer", weight=W, re=0.15)
    assert particles.numpy("answer")[fluid] == pytest.approx(weights(r, W, 0.15).sum(axis=1)[fluid])


def test_arguments_change_without_compiling_again(runtime):
    particles, pairs, _, w = filled(2)
    fluid = particles.numpy("kind") == FLUID

    @pair_term()
    def scaled(a, b, r, w, factor):
        return w * factor

    from spume.pairs import _pair_kernel

    made = []
    for factor in (2.0, -3.0):
        pair_sum(scaled, particles, pairs, out="answer", weight=W, re=0.21, arguments=(factor,))
        assert particles.numpy("answer")[fluid] == pytest.approx(factor * w.sum(axis=1)[fluid])
        made.append(_pair_kernel.cache_info().currsize)
    assert made[0] == made[1]


def test_another_field_behind_a_name(runtime):
    particles, pairs, _, w = filled(2)
    fluid = particles.numpy("kind") == FLUID
    pressure = np.random.default_rng(8).normal(size=particles.count)
    particles.set("pressure", pressure)
    pair_sum(difference, particles, pairs, out="answer", weight=W, re=0.21, fields={"scalar": "pressure"})
    expected = (w * (pressure[None, :] - pressure[:, None])).sum(axis=1)
    assert particles.numpy("answer")[fluid] == pytest.approx(expected[fluid])


def test_integer_sums(runtime):
    particles, pairs, _, w = filled(2)
    fluid = particles.numpy("kind") == FLUID
    pair_sum(whole_value, particles, pairs, out="answer", weight=W, re=0.21)
    expected = ((w > 0) * particles.numpy("whole")[None, :]).sum(axis=1)
    assert np.array_equal(particles.numpy("answer")[fluid], expected[fluid])


def test_a_view_replaces_what_a_row_sees(runtime):
    """A wall model supplies values of solid neighbours without the term knowing."""
    particles, pairs, r, w = filled(2)
    kind, s = particles.numpy("kind"), particles.numpy("scalar")
    fluid = kind == FLUID

    def image(a, b, r, slope):
        result = b.scalar
        if b.kind != 1:
            result = a.scalar + slope * r[0]
        return result

    view = PairView(kernels.func(image), ("scalar", "kind"), value="scalar", arguments=(4.0,))
    pair_sum(difference, particles, pairs, out="answer", weight=W, re=0.21, view=view)
    seen = np.where(fluid[None, :], s[None, :] - s[:, None], 4.0 * r[..., 0])
    assert particles.numpy("answer")[fluid] == pytest.approx((w * seen).sum(axis=1)[fluid])


def test_an_undeclared_read_does_not_compile(runtime):
    @pair_term(reads=("scalar",))
    def reads_more(a, b, r, w):
        return b.scalar * b.pressure

    _, particles, pairs = table(block(2, 3))
    with pytest.raises(Exception, match="pressure"):
        pair_sum(reads_more, particles, pairs, out="answer", weight=W, re=0.21)


def test_an_undeclared_read_of_a_row_does_not_compile(runtime):
    @row_term(reads=("scalar",))
    def reads_more(a):
        return a.velocity

    _, particles, _ = table(block(2, 3))
    with pytest.raises(Exception, match="velocity"):
        row_map(reads_more, particles, out="vector")


def test_as_many_terms_as_fields(runtime):
    _, particles, pairs = table(block(2, 3))
    with pytest.raises(ValueError, match="2 terms, but 1 fields"):
        pair_sum((plain, difference), particles, pairs, out=("answer",), weight=W, re=0.21)


def test_row_terms(runtime):
    @row_term(reads=("scalar", "position"))
    def formula(a, factor):
        return factor * a.scalar + a.position[1]

    particles, _, _, _ = filled(2)
    wall = particles.numpy("kind") == WALL
    row_map(formula, particles, out="answer", rows=WALL, arguments=(3.0,))
    expected = 3.0 * particles.numpy("scalar") + particles.numpy("position")[:, 1]
    assert particles.numpy("answer")[wall] == pytest.approx(expected[wall])
    assert not particles.numpy("answer")[~wall].any()


def test_totals_and_largest_norms(every_runtime):
    particles, _, _, _ = filled(3)
    kind, s = particles.numpy("kind"), particles.numpy("scalar")
    assert particles.total("scalar", WALL) == pytest.approx(float(s[kind == WALL].sum()), rel=1e-4)
    assert particles.total("whole") == particles.numpy("whole").sum()
    velocity = np.random.default_rng(1).normal(size=(particles.count, 3))
    particles.set("velocity", velocity)
    assert particles.largest_norm("velocity", FLUID) == pytest.approx(
        np.linalg.norm(velocity, axis=1)[kind == FLUID].max(), rel=1e-6
    )
    for row in np.flatnonzero(kind == FLUID)[:6]:
        bad = velocity.copy()
        bad[row, 1] = np.nan
        particles.set("velocity", bad)
        assert np.isnan(particles.largest_norm("velocity", FLUID)), "NaN wins wherever it stands"


@pair_term(reads=("density", "scalar"))
def shared_mass(a, b, r, w):
    return b.density * b.scalar


def test_a_number_that_all_rows_have_is_read_from_the_row_itself_until_one_has_another(every_runtime):
    particles, pairs, _, w = filled(3)
    near, s, fluid = w > 0, particles.numpy("scalar"), particles.numpy("kind") == FLUID
    for change in (1.0, 3.0):
        density = np.full(particles.count, 1000.0)
        density[::2] *= change
        particles.set("density", density)
        assert particles.uniform("density") == (change == 1.0)
        pair_sum(shared_mass, particles, pairs, out="answer", weight=W, re=0.21)
        assert particles.numpy("answer")[fluid] == pytest.approx((near * (density * s)).sum(axis=1)[fluid], rel=2e-4)


def test_what_a_step_writes_or_has_components_is_never_one_number_of_all_rows(every_runtime):
    particles, _, _, _ = filled(2)
    particles.set("pressure", np.ones(particles.count))
    particles.set("to_surface", np.ones((particles.count, 2)))
    assert not particles.uniform("pressure")
    assert not particles.uniform("to_surface")
    assert not particles.uniform("id")
    particles.set("kind", np.full(particles.count, FLUID))
    assert particles.uniform("kind")
    particles.insert({"position": np.zeros((1, 2)), "kind": [WALL]})
    assert not particles.uniform("kind")


def test_whole_minimum_and_maximum_of_a_lone_row(every_runtime):
    """No integer holds the largest number: what it becomes is anything, so another one stands for it."""
    _, particles, pairs = table([[0.0, 0.0], [0.1, 0.0], [5.0, 5.0]])
    alone = particles.numpy("position")[:, 0] > 1.0
    for extreme, sign in ((pair_min, 1), (pair_max, -1)):
        extreme(plain, particles, pairs, out="whole", weight=W, re=0.21)
        found = particles.numpy("whole")
        assert np.all(found[alone] == sign * 2_000_000_000)
        assert np.all(found[~alone] == 1)
