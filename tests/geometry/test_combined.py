"""Union, difference, intersection: laws of sets, exact flat faces, seams, mistakes."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import spume
from spume.geometry import (
    Box,
    Cylinder,
    Difference,
    Grid,
    Intersection,
    Polygon,
    Sphere,
    Tank,
    Union,
    fill,
    wall_layers,
)
from spume.problems import CaseError

POINTS = {d: np.random.default_rng(3).uniform(-1.0, 1.0, (2000, d)) for d in (2, 3)}
corner = st.floats(-0.8, 0.3)
length = st.floats(0.1, 0.5)


@st.composite
def shapes(draw, d):
    low = tuple(draw(corner) for _ in range(d))
    if draw(st.booleans()):
        return Sphere(centre=low, radius=draw(length))
    return Box(lower=low, upper=tuple(x + draw(length) for x in low))


@settings(max_examples=25, deadline=None)
@given(d=st.sampled_from((2, 3)), data=st.data())
def test_laws_of_sets(d, data):
    a, b, c = (data.draw(shapes(d)) for _ in range(3))
    x = POINTS[d]
    ina, inb, inc = (s.inside(x) for s in (a, b, c))
    assert np.array_equal(Union(of=(a, b, c)).inside(x), ina | inb | inc)
    rest = ina & ~inb & ~inc
    if rest.any():
        assert np.array_equal(Difference(of=a, without=(b, c)).inside(x), rest)
    if (ina & inb).any():
        both = Intersection(of=(a, b))
        assert np.array_equal(both.inside(x), ina & inb)
        # |A or B| = |A| + |B| - |A and B|, on the facets of curved shapes
        sum_of = a.facets().measure() + b.facets().measure()
        assert Union(of=(a, b)).measure() == pytest.approx(sum_of - both.measure(), rel=1e-6)


@settings(max_examples=20, deadline=None)
@given(d=st.sampled_from((2, 3)), data=st.data())
def test_distance_is_that_of_the_combined_surface(d, data):
    """No point of the surface is nearer, the nearest point is on it, and the sign is that of the inside."""
    a, b = (data.draw(shapes(d)) for _ in range(2))
    shape = Union(of=(a, b))
    x = POINTS[d][:300]
    on, _ = shape.facets().samples(4000)
    best = np.linalg.norm(x[:, None] - on[None], axis=2).min(axis=1)
    distance = shape.distance(x)
    assert np.all(np.abs(distance) <= best + 1e-3)
    assert np.all(np.abs(distance) >= best - 0.1)
    assert np.array_equal(distance < 0, shape.inside(x))
    assert np.abs(shape.distance(shape.nearest(x))).max() < 1e-3
    near = np.abs(distance) < 0.1
    within = shape.distance_within(x, 0.1)
    assert within[near] == pytest.approx(distance[near])
    assert np.array_equal(np.sign(within), np.sign(distance))


@pytest.mark.parametrize("d", [2, 3])
def test_walls_of_two_boxes_in_one_are_those_of_the_box(d):
    z = (0.0,) * (d - 2)
    up = (0.5,) * (d - 2)
    whole = Box(lower=(0.0, 0.0, *z), upper=(1.0, 0.6, *up))
    union = Union(
        of=(Box(lower=(0.0, 0.0, *z), upper=(0.4, 0.6, *up)), Box(lower=(0.4, 0.0, *z), upper=(1.0, 0.6, *up)))
    )
    hole = Difference(
        of=Box(lower=(0.0, 0.0, *z), upper=(1.4, 0.6, *up)),
        without=Box(lower=(1.0, -0.2, *(v - 0.2 for v in z)), upper=(1.6, 0.8, *(v + 0.2 for v in up))),
    )
    grid = Grid((0.0,) * d, 0.1)
    for wetted in ("inside", "outside"):
        rows = wall_layers(whole, grid, 3, wetted=wetted)
        for shape in (union, hole):
            same = wall_layers(shape, grid, 3, wetted=wetted)
            assert np.array_equal(same.position, rows.position)
            assert np.array_equal(same.wall, rows.wall)
            assert same.to_surface == pytest.approx(rows.to_surface, abs=1e-12)
            assert np.array_equal(same.exposed, rows.exposed)
            assert np.array_equal(same.master, rows.master)
    assert np.array_equal(fill(union, grid), fill(whole, grid))


def test_nearest_point_in_a_notch_is_on_its_edge():
    """A point above a notch: the face below is cut away, the nearest point left is the notch's rim."""
    block = Difference(of=Box(lower=(0, 0), upper=(1, 1)), without=Box(lower=(0.4, 0.5), upper=(0.6, 1.5)))
    rims = block.nearest(np.array([[0.45, 1.1], [0.56, 1.2]]))
    assert rims == pytest.approx(np.array([[0.4, 1.0], [0.6, 1.0]]), abs=1e-7)
    assert block.nearest(np.array([[0.5, 0.45]])) == pytest.approx(np.array([[0.5, 0.5]]), abs=1e-7)
    assert block.distance(np.array([[0.45, 0.9]])) == pytest.approx([0.05])
    assert block.measure() == pytest.approx(0.9)
    assert block.surface() == pytest.approx(5.0)


@pytest.mark.parametrize("shape", [
    Sphere(centre=(0.03, 0.01, 0.02), radius=0.5),
    Cylinder(start=(-0.2, -0.3, 0.0), end=(0.2, 0.3, 0.4), radius=0.3),
    Difference(of=Sphere(centre=(0.0, 0.0, 0.0), radius=0.5), without=Box(lower=(0, 0, 0), upper=(1, 1, 1))),
    Union(of=(Sphere(centre=(-0.2, 0.0, 0.0), radius=0.3), Sphere(centre=(0.2, 0.0, 0.0), radius=0.3))),
], ids=lambda s: s.key)  # fmt: skip
def test_volume_of_filled_shapes_converges(shape):
    errors = []
    for l0 in (0.1, 0.025):
        grid = Grid((0.0, 0.0, 0.0), l0)
        errors.append(abs(len(fill(shape, grid)) * l0**3 / shape.measure() - 1.0))
    assert errors[1] < 0.01
    assert errors[1] < max(errors[0], 0.005)


def test_keys_by_path_and_in_python():
    spec = {"kind": "difference", "of": {"kind": "box", "lower": [0.0, 0.0], "upper": [1.0, 0.4]}}
    spec["without"] = {"kind": "sphere", "centre": [0.5, 0.4], "radius": 0.1}  # one needs no brackets
    water = spume.Fluid.model_validate({"name": "w", "shape": spec})
    assert water.shape == Difference(
        of=Box(lower=(0, 0), upper=(1, 0.4)), without=[Sphere(centre=(0.5, 0.4), radius=0.1)]
    )


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Union(of=()), "at least 1"),
        (lambda: Union(of=(Tank(lower=(0, 0), upper=(1, 1)),)), 'use the shape "box"'),
        (lambda: Union(of=(Box(lower=(0, 0), upper=(1, 1)), Box(lower=(0, 0, 0), upper=(1, 1, 1)))), "two-dimensional"),
        (
            lambda: Difference(of=Box(lower=(0, 0), upper=(1, 1)), without=Box(lower=(-1, -1), upper=(2, 2))),
            "nothing is",
        ),
        (
            lambda: Intersection(of=(Sphere(centre=(0, 0), radius=1), Sphere(centre=(3, 0), radius=1))),
            "nothing in common",
        ),
        (lambda: Difference(of=Box(lower=(0, 0), upper=(1, 1))), "this key is required"),
    ],
)
def test_impossible_combinations_are_refused(make, words):
    with pytest.raises(CaseError, match=words):
        make()


def test_misspelt_key_deep_inside_is_named():
    overrides = ['body.tank.shape={kind="union", of=[{kind="box", lower=[0.0, 0.0], uper=[1.0, 1.0]}]}']
    with pytest.raises(spume.CaseError, match=r"body\.tank\.shape\.of\.0\.uper.*did you mean 'upper'"):
        spume.load("hydrostatic", overrides)


def test_snapping_reaches_the_parts():
    shape = Difference(
        of=Box(lower=(0.0, 0.0), upper=(1.013, 1.0)), without=Polygon(vertices=((0, 0), (0.513, 0), (0.513, 0.5)))
    )
    snapped, said = shape.snapped(Grid((0.0, 0.0), 0.02))
    assert snapped.of.upper == pytest.approx((1.02, 1.0))
    assert snapped.without[0].vertices[1] == pytest.approx((0.52, 0.0))
    assert len(said) == 2  # the box's upper x, and the polygon's upright edge
