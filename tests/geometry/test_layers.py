"""Walls made as layers: counts, corners, rims, masters."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spume.geometry import Box, Grid, Polygon, Sphere, Tank, fill, wall_layers

L0 = 0.1
OPEN_TANK = Tank(lower=(0, 0), upper=(1.0, 0.5), open=("top",))


def row(layers, x):
    """Return the index of the row at a position."""
    (index,) = np.flatnonzero(np.all(np.abs(layers.position - x) < 1e-9, axis=1))
    return index


@given(nx=st.integers(1, 12), ny=st.integers(1, 12), n=st.integers(1, 4))
@settings(max_examples=30)
def test_count_of_a_closed_tank(nx, ny, n):
    tank = Tank(lower=(0, 0), upper=(nx * L0, ny * L0))
    layers = wall_layers(tank, Grid((0.0, 0.0), L0), n, wetted="inside")
    assert len(layers.position) == (nx + 2 * n) * (ny + 2 * n) - nx * ny
    assert layers.wall.sum() == (nx + 2) * (ny + 2) - nx * ny


def test_open_tank_ends_at_its_rim():
    layers = wall_layers(OPEN_TANK, Grid((0.0, 0.0), L0), 3, wetted="inside")
    assert len(layers.position) == 16 * 3 + 2 * 3 * 5
    assert layers.position[:, 1].max() == pytest.approx(0.45)
    assert layers.wall.sum() == 12 + 2 * 5 + 2 * 2


def test_the_rim_of_an_open_tank_is_a_surface():
    """Water that runs over it stands on it; what is as near to the wetted face belongs to that."""
    layers = wall_layers(OPEN_TANK, Grid((0.0, 0.0), L0), 3, wetted="inside")
    for x in (-0.15, -0.25):
        rim = row(layers, [x, 0.45])
        assert layers.wall[rim]
        assert layers.to_surface[rim] == pytest.approx([0.0, 0.05])
        assert layers.exposed[rim] & 8, "its upper face"
    assert layers.to_surface[row(layers, [-0.05, 0.45])] == pytest.approx([0.05, 0.0])
    below = row(layers, [-0.25, 0.35])
    assert not layers.wall[below]
    assert layers.to_surface[below] == pytest.approx([0.0, 0.15])
    assert layers.position[layers.master[below]] == pytest.approx([-0.25, 0.45])
    assert layers.to_surface[row(layers, [-0.25, 0.15])] == pytest.approx([0.25, 0.0])


def test_first_layer_is_one_spacing_from_the_fluid():
    grid = Grid((0.0, 0.0), L0)
    layers = wall_layers(OPEN_TANK, grid, 3, wetted="inside")
    fluid = fill(Box(lower=(0, 0), upper=(1.0, 0.3)), grid)
    gaps = np.linalg.norm(layers.position[:, None] - fluid[None], axis=2)
    assert gaps.min() == pytest.approx(L0)
    assert not layers.wall[gaps.min(axis=1) > 1.5 * L0][layers.position[gaps.min(axis=1) > 1.5 * L0][:, 1] < 0].any()


def test_rows_are_ordered_with_the_last_axis_fastest():
    long = Tank(lower=(0, 0), upper=(20.0, 15.0), open=("top",))
    x = wall_layers(long, Grid((0.0, 0.0), L0), 3, wetted="inside").position
    assert len(x) == 206 * 3 + 2 * 3 * 150
    assert np.array_equal(np.lexsort(x.T[::-1]), np.arange(len(x)))


@pytest.mark.parametrize("depth", [0.05, 0.15, 0.25])
def test_corner_diagonal_takes_the_corner_row(depth):
    layers = wall_layers(OPEN_TANK, Grid((0.0, 0.0), L0), 3, wetted="inside")
    corner = row(layers, [-depth, -depth])
    assert layers.to_surface[corner] == pytest.approx([depth, depth])
    assert layers.position[layers.master[corner]] == pytest.approx([-0.05, -0.05])
    assert layers.wall[layers.master[corner]]


def test_masters_lie_straight_ahead_behind_a_flat_wall():
    layers = wall_layers(OPEN_TANK, Grid((0.0, 0.0), L0), 3, wetted="inside")
    floor = (layers.position[:, 1] < 0) & (layers.position[:, 0] > 0) & (layers.position[:, 0] < 1)
    ahead = layers.position[layers.master[floor]]
    assert ahead[:, 0] == pytest.approx(layers.position[floor][:, 0])
    assert ahead[:, 1] == pytest.approx(-0.05)
    assert np.array_equal(layers.master[layers.wall], np.flatnonzero(layers.wall))


def test_edges_of_a_block_are_mirror_symmetric():
    block = Box(lower=(-0.4, -0.3), upper=(0.4, 0.3))
    layers = wall_layers(block, Grid((-0.4, -0.3), L0), 3, wetted="outside")
    assert len(layers.position) == 8 * 6  # three layers from both sides leave no core
    table = {
        tuple(np.round(x, 6)): (tuple(np.round(s, 6)), tuple(np.round(layers.position[m], 6)))
        for x, s, m in zip(layers.position, layers.to_surface, layers.master, strict=True)
    }
    for (x, y), ((sx, sy), (mx, my)) in table.items():
        assert table[-x + 0.0, y] == ((-sx + 0.0, sy), (-mx + 0.0, my))
        assert table[x, -y + 0.0] == ((sx, -sy + 0.0), (mx, -my + 0.0))


def test_dummies_of_an_edge_take_the_row_ahead_of_them():
    block = Box(lower=(0, 0), upper=(2.0, 2.0))
    layers = wall_layers(block, Grid((0.0, 0.0), L0), 3, wetted="outside")
    for x, ahead in (
        ([0.15, 0.15], [0.05, 0.15]),  # equally far from both faces: the first axis decides
        ([0.25, 0.15], [0.25, 0.05]),
        ([0.15, 0.25], [0.05, 0.25]),
        ([0.25, 0.25], [0.05, 0.25]),
        ([1.75, 0.25], [1.95, 0.25]),
    ):
        dummy = row(layers, x)
        assert layers.position[layers.master[dummy]] == pytest.approx(ahead)
        assert (layers.position + layers.to_surface)[dummy] * np.array([0, 1]) == pytest.approx(
            np.array([0, 1]) * (layers.position + layers.to_surface)[layers.master[dummy]]
        )


def test_a_large_block_keeps_its_core_empty():
    block = Box(lower=(0, 0), upper=(2.0, 2.0))
    layers = wall_layers(block, Grid((0.0, 0.0), L0), 3, wetted="outside")
    assert len(layers.position) == 20 * 20 - 14 * 14
    assert layers.wall.sum() == 20 * 20 - 18 * 18


def test_3d_corner():
    tank = Tank(lower=(0, 0, 0), upper=(0.4, 0.4, 0.4), open=("top",))
    layers = wall_layers(tank, Grid((0.0, 0.0, 0.0), L0), 3, wetted="inside")
    corner = row(layers, [-0.05, -0.05, -0.05])
    assert layers.wall[corner]
    assert layers.position[layers.master[row(layers, [-0.15, -0.15, -0.15])]] == pytest.approx([-0.05] * 3)
    assert layers.wall.sum() == 6 * 6 * 5 - 4 * 4 * 4 + (10 * 10 - 6 * 6), "with the rim"


@pytest.mark.parametrize(
    ("shape", "wetted"),
    [
        (Sphere(centre=(0.0, 0.0), radius=0.7), "inside"),
        (Sphere(centre=(0.0, 0.0), radius=0.7), "outside"),
        (Sphere(centre=(0.0, 0.0, 0.0), radius=0.5), "inside"),
        (Polygon(vertices=((0, 0), (1.5, 0), (1.5, 1.0), (0.3, 0.7))), "inside"),
        (Polygon(vertices=((0, 0), (1.5, 0), (1.5, 1.0), (0.3, 0.7))), "outside"),
    ],
)
def test_any_shape_surrounds_the_fluid_with_enough_rows(shape, wetted):
    """Every solid cell within 2.1 l0 of a wet one has a row, none is wet, and masters are wall rows."""
    grid = Grid(tuple(shape.bounds()[0]), L0)
    layers = wall_layers(shape, grid, 3, wetted=wetted)
    sign = 1.0 if wetted == "inside" else -1.0
    assert np.all(sign * shape.distance(layers.position) > -1e-7)
    assert layers.wall[layers.master].all()
    box = Box(lower=tuple(shape.bounds()[0] - 1.0), upper=tuple(shape.bounds()[1] + 1.0))
    cells = fill(box, grid)
    depth = sign * shape.distance(cells)
    wet, solid = cells[depth < -1e-7], cells[(depth > 1e-7)]
    near = np.zeros(len(solid), dtype=bool)
    for part in np.array_split(np.arange(len(solid)), 40):
        near[part] = (np.linalg.norm(solid[part][:, None] - wet[None], axis=2) < 2.1 * L0).any(axis=1)
    have = {tuple(c) for c in grid.cells(layers.position)}
    missing = [c for c in map(tuple, grid.cells(solid[near])) if c not in have]
    assert missing == []
