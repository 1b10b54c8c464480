"""Shapes: distances, nearest points, measures, snapping to the lattice."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spume.geometry import Box, Cylinder, Difference, Extrusion, Grid, Intersection, Polygon, Sphere, Tank, Union, fill
from spume.geometry.grid import TooManyCellsError
from spume.problems import CaseError

SHAPES = [
    Box(lower=(-0.4, -0.2), upper=(0.5, 0.3)),
    Box(lower=(-0.4, -0.2, -0.1), upper=(0.5, 0.3, 0.45)),
    Sphere(centre=(0.1, -0.05), radius=0.4),
    Sphere(centre=(0.1, -0.05, 0.0), radius=0.4),
    Cylinder(start=(-0.3, -0.2, -0.1), end=(0.3, 0.3, 0.4), radius=0.3),
    Cylinder(start=(0.0, 0.0, -0.4), end=(0.0, 0.0, 0.4), radius=0.3),
    Polygon(vertices=((-0.4, -0.4), (0.5, -0.4), (0.5, 0.1), (0.0, 0.0), (-0.4, 0.5))),
    Tank(lower=(-0.4, -0.2), upper=(0.5, 0.3)),
    *(
        Extrusion(
            vertices=((-0.4, -0.4), (0.5, -0.4), (0.5, 0.1), (0.0, 0.0), (-0.4, 0.5)), axis=a, start=-0.3, end=0.2
        )
        for a in "xyz"
    ),
    Union(of=(Box(lower=(-0.4, -0.4), upper=(0.4, 0.0)), Box(lower=(-0.4, 0.0), upper=(0.0, 0.4)))),
    Union(of=(Box(lower=(-0.4, -0.4), upper=(0.4, 0.1)), Sphere(centre=(0.1, 0.0), radius=0.3))),
    Union(of=(Sphere(centre=(-0.2, 0.0, 0.0), radius=0.3), Sphere(centre=(0.2, 0.0, 0.0), radius=0.3))),
    Difference(
        of=Box(lower=(-0.4, -0.4, -0.4), upper=(0.4, 0.4, 0.4)),
        without=(
            Sphere(centre=(0.4, 0.4, 0.4), radius=0.5),
            Cylinder(start=(-0.2, -0.2, -0.5), end=(-0.2, -0.2, 0.5), radius=0.15),
        ),
    ),
    Difference(of=Sphere(centre=(0.0, 0.0), radius=0.6), without=Box(lower=(-0.2, -0.2), upper=(0.2, 0.2))),
    Intersection(of=(Sphere(centre=(0.0, 0.0, 0.0), radius=0.5), Box(lower=(-0.3, -0.3, -0.3), upper=(0.6, 0.6, 0.6)))),
]
SEAMS = {"union", "difference", "intersection"}
"""Shapes whose seams are found on facets that follow a curved part to 2e-4 of its radius."""


def points(shape, number=2000):
    d = len(shape.bounds()[0])
    return np.random.default_rng(1).uniform(-0.8, 0.8, (number, d))


@pytest.mark.parametrize("shape", SHAPES, ids=lambda s: s.key)
class TestEveryShape:
    def test_distance_is_that_of_the_nearest_point(self, shape):
        x = points(shape)
        gap = np.linalg.norm(shape.nearest(x) - x, axis=1)
        assert np.abs(shape.distance(x)) == pytest.approx(gap, abs=1e-12)
        assert np.array_equal(shape.distance(x) < 0, shape.inside(x))

    def test_nearest_point_is_on_the_surface(self, shape):
        on = shape.nearest(points(shape))
        assert shape.distance(on) == pytest.approx(0.0, abs=2e-4 if shape.key in SEAMS else 1e-9)

    def test_no_surface_point_is_nearer(self, shape):
        x = points(shape, 200)
        surface = shape.nearest(points(shape, 5_000))
        best = np.linalg.norm(x[:, None] - surface[None], axis=2).min(axis=1)
        assert np.all(np.abs(shape.distance(x)) <= best + (3e-4 if shape.key in SEAMS else 1e-12))

    def test_distance_has_slope_one_at_most(self, shape):
        x = points(shape)
        y = np.roll(x, 1, axis=0)
        change = np.abs(shape.distance(x) - shape.distance(y))
        assert np.all(change <= np.linalg.norm(x - y, axis=1) + (3e-4 if shape.key in SEAMS else 1e-12))

    def test_facets_enclose_the_same_region(self, shape):
        facets = shape.facets()
        assert facets.measure() == pytest.approx(shape.measure(), rel=1e-6)
        assert facets.surface() == pytest.approx(shape.surface(), rel=1e-3)
        assert np.abs(facets.normals.sum(axis=0)).max() < 1e-12  # closed
        on, normal = facets.samples(300)
        assert np.abs(shape.distance(on)).max() < 2e-4
        assert not shape.inside(on + 1e-3 * normal).any() or shape.key in SEAMS  # but in a notch
        assert shape.inside(on - 1e-3 * normal).mean() > 0.98

    def test_measure_is_the_share_of_random_points(self, shape):
        x = points(shape, 20_000)
        expected = shape.measure() / 1.6 ** x.shape[1]
        assert shape.inside(x).mean() == pytest.approx(expected, abs=4 * math.sqrt(0.25 / len(x)))

    def test_surface_is_the_slope_of_the_measure(self, shape):
        """d(volume)/d(offset) at the surface is its area: count points in a thin shell."""
        x = points(shape, 60_000)
        thin = 0.02
        shell = np.abs(shape.distance_within(x, thin)) < thin
        d = x.shape[1]
        assert shell.mean() * 1.6**d / (2 * thin) == pytest.approx(shape.surface(), rel=0.05)

    def test_bounds_hold_the_inside_tightly(self, shape):
        x = points(shape, 20_000)
        x = x[shape.inside(x)]
        lower, upper = shape.bounds()
        assert np.all(x >= lower)
        assert np.all(x <= upper)
        assert x.min(axis=0) == pytest.approx(lower, abs=0.12)
        assert x.max(axis=0) == pytest.approx(upper, abs=0.12)


def test_open_faces_are_no_surface():
    tank = Tank(lower=(0, 0), upper=(1, 1), open=("top", "left"))
    x = np.array([[0.01, 0.5], [0.5, 0.49], [0.9, 0.95]])
    assert tank.nearest(x).tolist() == [[0.01, 0.0], [0.5, 0.0], [1.0, 0.95]]
    beyond = np.array([[-0.1, 0.5], [0.5, 1.1], [1.1, 0.5], [0.5, -0.1], [1.1, 1.1]])
    assert tank.solid_side(beyond).tolist() == [False, False, True, True, False]


def test_gap_leaves_open_faces_out():
    tank = Tank(lower=(0, 0), upper=(1, 1), open=("top", "left"))
    x = np.array([[0.01, 0.5], [-1.0, 0.5], [0.5, 3.0], [0.5, -0.2], [2.0, 2.0]])
    assert tank.gap(x) == pytest.approx([0.5, math.hypot(1.0, 0.5), math.hypot(0.5, 2.0), 0.2, math.sqrt(2)])
    closed = Tank(lower=(0, 0), upper=(1, 1))
    inner = np.random.default_rng(0).uniform(-1, 2, (1000, 2))
    assert closed.gap(inner) == pytest.approx(np.abs(closed.distance(inner)))


def test_open_faces_have_no_area():
    assert Tank(lower=(0, 0), upper=(3, 2), open=("top",)).surface() == pytest.approx(7.0)
    room = Tank(lower=(0, 0, 0), upper=(1, 2, 3), open=("top", "front"))
    assert room.surface() == pytest.approx(22 - 2 - 3)


def test_faces_of_a_3d_tank():
    tank = Tank(lower=(0, 0, 0), upper=(1, 1, 1), open=("front", "top"))
    assert tank.open_faces().tolist() == [[False, True, False], [False, False, True]]


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Box(lower=(0, 0), upper=(1, 0)), "less than upper"),
        (lambda: Box(lower=(0, 0), upper=(1, 1, 1)), "as many numbers"),
        (lambda: Sphere(centre=(0, 0), radius=0), "greater than 0"),
        (lambda: Sphere(centre=(0, math.nan), radius=1), "finite"),
        (lambda: Cylinder(start=(0, 0, 0), end=(0, 0, 0), radius=1), "must differ"),
        (lambda: Cylinder(start=(0, 0), end=(0, 1), radius=1), "three numbers"),
        (lambda: Polygon(vertices=((0, 0), (1, 0))), "at least 3"),
        (lambda: Polygon(vertices=((0, 0), (1, 1), (1, 0), (0, 1))), "meet"),
        (lambda: Polygon(vertices=((0, 0), (1, 0), (1, 0), (0, 1))), "the same"),
        (lambda: Polygon(vertices=((0, 0), (2, 0), (2, 1), (1, 0), (0, 1))), "meet"),
        (lambda: Tank(lower=(0, 0), upper=(1, 1), open=("left", "right", "bottom", "top")), "no walls"),
        (lambda: Tank(lower=(0, 0), upper=(1, 1), open=("front",)), "3D only"),
    ],
)
def test_impossible_shapes_are_refused(make, words):
    with pytest.raises(CaseError, match=words):
        make()


@given(
    nx=st.integers(1, 40),
    ny=st.integers(1, 40),
    l0=st.floats(1e-4, 10.0),
    x0=st.floats(-50.0, 50.0),
    y0=st.floats(-50.0, 50.0),
)
def test_box_of_whole_cells_is_filled_exactly(nx, ny, l0, x0, y0):
    grid = Grid((x0, y0), l0)
    box, said = Box(lower=(x0, y0), upper=(x0 + nx * l0, y0 + ny * l0)).snapped(grid)
    x = fill(box, grid)
    assert said == []
    assert len(x) == nx * ny
    assert x.min(axis=0) == pytest.approx([x0 + l0 / 2, y0 + l0 / 2])
    assert x.max(axis=0) == pytest.approx([x0 + (nx - 0.5) * l0, y0 + (ny - 0.5) * l0])


def test_disk_is_filled_symmetrically_and_fully():
    disk = Sphere(centre=(0.3, 0.2), radius=0.5)
    x = fill(disk, Grid((-0.2, -0.3), 0.01)) - [0.3, 0.2]
    assert len(x) * 1e-4 == pytest.approx(disk.measure(), rel=2e-3)
    for mirror in ((-1, 1), (1, -1)):
        assert {tuple(p) for p in np.round(x * mirror, 9)} == {tuple(p) for p in np.round(x, 9)}


def test_snapping_says_what_it_moved():
    grid = Grid((0.0, 0.0), 0.02)
    box, said = Box(lower=(0.0, 0.0), upper=(1.61, 0.6)).snapped(grid)
    assert box.upper == pytest.approx((1.62, 0.6))  # half-way goes up
    assert said == ["upper x = 1.61 m is no multiple of the spacing of 0.02 m: moved to 1.62 m"]
    with pytest.raises(ValueError, match="half a spacing"):
        Box(lower=(0.0, 0.0), upper=(0.009, 1.0)).snapped(grid)


def test_snapping_moves_only_level_edges_of_a_polygon():
    beach = Polygon(vertices=((0.0, 0.0), (1.013, 0.0), (1.013, 0.307), (0.333, 0.1)))
    snapped, said = beach.snapped(Grid((0.0, 0.0), 0.02))
    assert snapped.vertices == ((0.0, 0.0), (1.02, 0.0), (1.02, 0.307), (0.333, 0.1))
    moved = "x of vertices 2, 3 = 1.013 m is no multiple of the spacing of 0.02 m: moved to 1.02 m"
    assert said == [moved], "each coordinate once"


def test_too_many_cells_are_refused_before_memory_is_asked_for():
    with pytest.raises(TooManyCellsError, match="1e-09 m"):
        fill(Box(lower=(0, 0), upper=(1, 1)), Grid((0.0, 0.0), 1e-9))
