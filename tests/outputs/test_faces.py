"""Faces of walls in 3D: without gaps, cut at edges, and those open that would hide the water."""

import numpy as np
import pytest
from PIL import Image

from spume.outputs import pictures, raster
from spume.outputs.faces import faces_of, lattice_axes
from spume.outputs.vtkhdf import Frame

L0 = 0.1


def cells(lower, upper):
    """Return the middles of the cells in a box [l0], in m."""
    axes = [np.arange(a, b) + 0.5 for a, b in zip(lower, upper, strict=True)]
    return L0 * np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def block(lower, upper, body=0):
    """Return rows of a box with corners [l0]: positions, vectors to the nearest side [m], body."""
    x, lower, upper = cells(lower, upper), L0 * np.array(lower), L0 * np.array(upper)
    deep = np.stack([x - lower, upper - x], axis=2).reshape(-1, 6)
    side = deep.argmin(axis=1)
    to_surface = np.zeros_like(x)
    to_surface[np.arange(len(x)), side // 2] = np.where(side % 2 == 0, -1.0, 1.0) * deep.min(axis=1)
    return x, to_surface, np.full(len(x), body)


def vessel(lower, upper, thick, body=0):
    """Return rows of a box open above, with walls and a floor of a thickness [l0], wet inside and outside."""
    x, outwards, index = block(lower, upper, body)
    low, high = L0 * (np.array(lower) + thick), L0 * (np.array(upper) - thick)
    high[2] = np.inf
    inwards = np.clip(x, low, high) - x
    solid = np.any(inwards != 0.0, axis=1)
    inner = np.linalg.norm(inwards, axis=1) < np.linalg.norm(outwards, axis=1) + 1e-9
    return x[solid], np.where(inner[:, None], inwards, outwards)[solid], index[solid]


def frame_of(water, *bodies):
    x, to_surface, body = (np.concatenate(parts) for parts in zip(*bodies, strict=True))
    rows = len(water)
    arrays = {
        "position": np.concatenate([water, x]),
        "to_surface": np.concatenate([0.0 * water, to_surface]),
        "kind": np.repeat([1, 0], [rows, len(x)]),
        "body": np.concatenate([np.full(rows, -1), body]),
        "velocity": np.zeros((rows + len(x), 3)),
    }
    arrays["kind"][rows:] = np.where(np.linalg.norm(to_surface, axis=1) < 0.9 * L0, 2, 4)
    return Frame(0.0, 0, arrays, L0, 3, {})


def area(faces):
    return np.linalg.norm(np.cross(faces.first, faces.second), axis=1)


NOWHERE = np.zeros((0, 3))


def test_a_block_is_closed_at_its_edges():
    faces = faces_of(frame_of(NOWHERE, block((0, 0, 0), (6, 5, 4))))
    assert area(faces).sum() == pytest.approx(2 * (30 + 24 + 20) * L0**2)
    points, owner = faces.points(np.ones(len(faces), dtype=bool), 4)
    assert points.min(axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=1e-3 * L0)
    assert points.max(axis=0) == pytest.approx([0.6, 0.5, 0.4], abs=1e-3 * L0)
    top = points[faces.normal[owner, 2] > 0.9]
    filled = np.unique(np.floor(top[:, :2] / (0.25 * L0) + 1e-6), axis=0)
    assert len(filled) == 16 * 30  # every piece of every cell


def test_a_slanted_plane_has_no_gaps():
    """Tiles of a plane: one for each column of cells, in the plane, of the column's width."""
    n = np.array([0.3, -0.2, 1.0]) / np.linalg.norm([0.3, -0.2, 1.0])
    x = cells((0, 0, -12), (12, 12, 12))
    deep = -(x - [0.6, 0.6, 0.0]) @ n
    rows = (deep > 0.0) & (deep < 3.0 * L0)
    faces = faces_of(frame_of(NOWHERE, (x[rows], deep[rows, None] * n, np.zeros(rows.sum(), dtype=int))))
    up = faces[faces.normal @ n > 0.99]
    assert np.abs((up.centre - [0.6, 0.6, 0.0]) @ n).max() < 1e-9
    middle = up[(np.abs(up.centre[:, :2] - 0.6) < 0.4).all(axis=1)]
    assert np.cross(middle.first, middle.second)[:, 2] == pytest.approx(L0**2)
    assert len(np.unique(np.rint(middle.centre[:, :2] / L0 - 0.5), axis=0)) == 64


def test_a_round_body_has_no_gaps():
    """A cylinder along z with a lid: points at every angle, none off its surface by more than a fifth of a spacing."""
    x = cells((-6, -6, 0), (6, 6, 8))
    radius, top = np.hypot(x[:, 0], x[:, 1]), 0.8
    rows = radius < 0.45
    aside = x[rows] * [1, 1, 0] / radius[rows, None] * (0.45 - radius[rows, None])
    above = np.stack([0.0 * x[rows, 0], 0.0 * x[rows, 0], top - x[rows, 2]], axis=1)
    lid = above[:, 2] < 0.45 - radius[rows]
    to_surface = np.where(lid[:, None], above, aside)
    faces = faces_of(frame_of(NOWHERE, (x[rows], to_surface, np.zeros(rows.sum(), dtype=int))))
    points, owner = faces.points(np.ones(len(faces), dtype=bool), 6)
    away = np.hypot(points[:, 0], points[:, 1])
    round_about = np.abs(faces.normal[owner, 2]) < 0.5
    assert np.abs(away[round_about] - 0.45).max() < 0.2 * L0
    assert points[:, 2].max() == pytest.approx(top, abs=0.1 * L0)
    for z in (0.35, 0.75):
        ring = points[round_about & (np.abs(points[:, 2] - z) < 0.1 * L0)]
        angle = np.sort(np.arctan2(ring[:, 1], ring[:, 0]))
        assert np.diff(angle).max() * 0.45 < 0.35 * L0
    cover = points[~round_about & (points[:, 2] > 0.79)]
    assert np.hypot(cover[:, 0], cover[:, 1]).max() == pytest.approx(0.45, abs=0.2 * L0)


def test_the_axes_of_a_body_turn_with_it():
    a = 0.4
    turn = np.array([[np.cos(a), -np.sin(a), 0.0], [np.sin(a), np.cos(a), 0.0], [0.0, 0.0, 1.0]])
    x = cells((0, 0, 0), (4, 5, 6)) @ turn.T + 0.03
    axes = lattice_axes(x, L0)
    assert np.sort(np.abs(axes @ turn), axis=1) == pytest.approx(np.tile([0.0, 0.0, 1.0], (3, 1)), abs=1e-9)
    x, to_surface, body = block((0, 0, 0), (6, 5, 4))
    faces = faces_of(frame_of(NOWHERE, (x @ turn.T, to_surface @ turn.T, body)))
    assert area(faces).sum() == pytest.approx(2 * (30 + 24 + 20) * L0**2)


WATER = cells((0, 0, 0), (8, 8, 5))


def test_the_outside_of_a_vessel_is_open_and_a_block_in_it_is_not():
    block_in_it = block((9, 2, 0), (12, 5, 4), body=1)
    faces = faces_of(frame_of(WATER, vessel((-3, -3, -3), (17, 11, 11), 3), block_in_it))
    assert not faces.obstacle[faces.body == 0].any()
    assert faces.obstacle[faces.body == 1].all()
    vessel_ = faces[faces.body == 0]
    out = np.any((vessel_.centre[:, :2] < -0.29) | (vessel_.centre[:, :2] > [1.69, 1.09]), axis=1)
    assert vessel_.outer[out & (np.abs(vessel_.normal[:, 2]) < 0.5)].all()
    inside = np.all((vessel_.centre > -0.01) & (vessel_.centre < [1.41, 0.81, 1.09]), axis=1)
    assert inside.sum() == 14 * 8 + 2 * 11 * (14 + 8)
    assert vessel_.outer[inside].sum() == 9  # below the block


def test_walls_of_several_boxes_hold_the_water_together():
    sides = [
        block((-3, -3, -3), (17, 11, 0), 0),
        block((-3, -3, 0), (0, 11, 11), 1),
        block((14, -3, 0), (17, 11, 11), 2),
        block((0, -3, 0), (14, 0, 11), 3),
        block((0, 8, 0), (14, 11, 11), 4),
    ]
    faces = faces_of(frame_of(WATER, *sides, block((9, 2, 0), (12, 5, 4), body=5)))
    assert np.unique(faces.body[faces.obstacle]).tolist() == [5]
    front = (faces.body == 3) & (faces.normal[:, 1] < -0.9)
    assert faces.outer[front].all()
    assert not faces.outer[(faces.body == 4) & (faces.normal[:, 1] < -0.9)].any()


def test_a_vessel_in_a_tank_shows_what_it_holds():
    water = np.concatenate([WATER, cells((14, 3, 2), (16, 5, 5))])
    faces = faces_of(frame_of(water, vessel((-3, -3, -3), (23, 11, 11), 3), vessel((12, 1, 0), (18, 7, 6), 2, body=1)))
    assert not faces.obstacle.any()
    right = (faces.body == 1) & (faces.normal[:, 0] > 0.9)
    assert faces.outer[right & (faces.centre[:, 0] > 1.79)].all()
    assert not faces.outer[right & (faces.centre[:, 0] < 1.41)].any()


def test_a_sphere_in_the_floor_is_a_body():
    x = cells((8, 2, -6), (14, 8, 6))
    way = x - [1.1, 0.5, 0.0]
    length = np.linalg.norm(way, axis=1)
    rows = length < 0.3
    ball = (x[rows], way[rows] / length[rows, None] * (0.3 - length[rows, None]), np.ones(rows.sum(), dtype=int))
    x, to_surface, body = vessel((-3, -3, -3), (17, 11, 11), 3)
    free = np.linalg.norm(x - [1.1, 0.5, 0.0], axis=1) > 0.3
    faces = faces_of(frame_of(WATER, (x[free], to_surface[free], body[free]), ball))
    assert faces.obstacle[faces.body == 1].all()
    assert not faces.obstacle[faces.body == 0].any()


def test_a_picture_shows_the_water_in_a_thick_vessel(tmp_path):
    frame = frame_of(WATER, vessel((-3, -3, -3), (11, 11, 11), 3))
    image = np.asarray(Image.open(pictures.draw_frames([frame], tmp_path / "p.png", dpi=50)).convert("RGB"), dtype=int)
    panel = image[:, : 3 * image.shape[1] // 4]
    blue = panel[:, :, 2] > panel[:, :, 0] + 40
    brown = panel[:, :, 0] > panel[:, :, 2] + 40
    assert (blue.mean() > 0.1, brown.any()) == (True, False)


def test_the_front_edge_of_the_water_is_whole(tmp_path):
    """Before the floor every ball of the lowest row is seen whole: the lower edge of the water is about a line."""
    frame = frame_of(WATER, vessel((-3, -3, -3), (17, 11, 11), 3))
    view = pictures.view_of([frame], pictures.OutputSettings(view_deg=(-90.0, 15.0)))
    image = pictures.paint(frame, view, (600, 900)).astype(int)
    blue = image[:, :, 2] > image[:, :, 0] + 40
    camera = raster.Camera(view.lower, view.upper, -90.0, 15.0, (600, 900))
    row, _, larger = camera.project(np.array([[0.05, 0.05, 0.05], [0.15, 0.05, 0.05], [0.75, 0.05, 0.05]]))
    wide = row[1, 0] - row[0, 0]
    columns = np.arange(int(row[0, 0]), int(row[2, 0]))
    lowest = np.array([np.flatnonzero(blue[:, column]).max() for column in columns])
    assert lowest.max() == pytest.approx(row[:, 1].max() + 0.6 * L0 * camera.scale * larger[0], abs=0.08 * wide)
    assert np.ptp(lowest) < 0.4 * wide
