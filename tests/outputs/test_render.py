"""Rendered pictures: the surface encloses the water, drops are spray, and what is missing is named."""

import sys

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from run_folders import write_run
from spume.cli import app
from spume.outputs import render
from spume.outputs.surface import filled
from spume.outputs.vtkhdf import Frame

SPACING = 0.1


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("render") / "run", width=0.4)


def frame_of(position, kind=1):
    rows = len(position)
    arrays = {"position": position, "kind": np.full(rows, kind), "velocity": np.zeros((rows, 3))}
    return Frame(0.0, 0, arrays, SPACING, 3, {})


def call(*words):
    result = CliRunner().invoke(app, [str(word) for word in words], env={"COLUMNS": "300"})
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def lattice(*counts):
    return (np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 3) + 0.5) * SPACING


def test_the_filled_part_of_space_is_one_inside_and_half_on_the_surface():
    position = lattice(16, 16, 8)
    wide = filled(position, np.array([-0.8] * 3), (64, 64, 48), 0.5 * SPACING, SPACING)
    column = wide[32, 32]
    height = -0.8 + 0.05 * np.arange(48)
    assert abs(column[np.argmin(np.abs(height - 0.4))] - 1.0) < 0.01
    assert abs(np.interp(0.8, height, column) - 0.5) < 0.01
    assert wide.sum() * (0.5 * SPACING) ** 3 == pytest.approx(len(position) * SPACING**3, rel=1e-3)


def test_the_surface_of_a_ball_of_water():
    pytest.importorskip("pyvista")
    from spume.outputs.surface import reconstruct

    position = lattice(20, 20, 20) - 1.0
    ball = position[np.linalg.norm(position, axis=1) < 0.8]
    speed = np.linalg.norm(ball, axis=1)
    surface = reconstruct(frame_of(ball), speed)
    assert surface.mesh.volume == pytest.approx(len(ball) * SPACING**3, rel=0.05)
    radius = np.linalg.norm(surface.mesh.points, axis=1)
    assert np.abs(radius - 0.8).max() < SPACING
    assert len(surface.spray) == 0
    assert abs(np.mean(surface.mesh["value"]) - 0.8) < SPACING


def test_a_drop_is_spray_and_no_surface():
    pytest.importorskip("pyvista")
    from spume.outputs.surface import reconstruct

    drop = np.array([[3.0, 3.0, 3.0]])
    surface = reconstruct(frame_of(np.concatenate([lattice(8, 8, 8), drop])), np.arange(513.0))
    assert surface.spray.tolist() == drop.tolist()
    assert surface.spray_values.tolist() == [512.0]
    assert surface.mesh.points.max() < 1.0
    none = reconstruct(frame_of(np.zeros((3, 3)), kind=2), np.zeros(3))
    assert none.mesh.n_points == 0


def test_walls_are_the_wetted_planes(run):
    pytest.importorskip("pyvista")
    import spume

    room, obstacle = render.walls(spume.open(run)[0])
    assert obstacle.n_points == 0
    assert np.allclose(room.bounds, (0.0, 1.0, 0.0, 0.4, 0.0, 1.0), atol=1e-6)
    assert room.area == pytest.approx(0.4 + 2 * 0.4 + 2 * 1.0)  # floor, two ends, two sides


def test_a_picture_shows_the_water(run, tmp_path):
    pytest.importorskip("pyvista")
    works, why = render.available()
    if not works:
        pytest.skip(f"no OpenGL: {why}")
    result = call("render", run, "--no-film", "--time", "0.2", "--out", tmp_path)
    assert result.exit_code == 0, result.output
    image = np.asarray(Image.open(tmp_path / "render.png").convert("RGB")).astype(int)
    panel = image[:, : 3 * image.shape[1] // 4]  # without the colour scale
    coloured = (np.ptp(panel, axis=2) > 25).mean()  # walls and text are grey
    assert 0.15 < coloured < 0.6
    assert [path.name for path in tmp_path.iterdir()] == ["render.png"]


@pytest.mark.parametrize("hidden", ["pyvista"])
def test_without_pyvista_the_command_that_mends_it_is_named(run, tmp_path, monkeypatch, hidden):
    monkeypatch.setitem(sys.modules, hidden, None)
    result = call("render", run, "--out", tmp_path)
    assert result.exit_code == 2
    assert 'needs PyVista, which is not installed: pip install "spume[view]"' in result.output
    assert list(tmp_path.iterdir()) == []


def test_without_opengl_the_remedy_is_named(run, tmp_path, monkeypatch):
    pytest.importorskip("pyvista")
    monkeypatch.setattr(render, "available", lambda: (False, "no display"))
    result = call("render", run, "--out", tmp_path)
    assert (result.exit_code, "apt install libgl1" in result.output) == (2, True)


def test_a_2d_run_is_referred_to_plot(tmp_path):
    folder = write_run(tmp_path / "flat")
    result = call("render", folder)
    assert (result.exit_code, "is a 2D run: spume plot" in result.output) == (2, True)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no program that only fails")
def test_an_attempt_that_crashes_is_no_opengl(monkeypatch):
    monkeypatch.setattr(sys, "executable", "false")
    assert render.available()[0] is False


def test_a_body_in_the_water_stands_on_the_floor():
    """A block of 0.6 m in a tank 1.6 m wide whose floor is at z = 0: closed above, nothing of it below the floor."""
    pytest.importorskip("pyvista")
    floor = lattice(16, 16, 3) * [1, 1, -1]
    block = lattice(6, 6, 6) + np.array([0.5, 0.5, 0.0])
    top, middle = floor[:, 2] > -0.06, block.mean(axis=0)
    away = block - middle
    axis = np.argmax(np.abs(away), axis=1)
    rows = np.arange(len(block))
    outside = np.abs(away[rows, axis]) > 0.24
    to_surface = np.zeros((len(floor) + len(block), 3))
    to_surface[np.flatnonzero(top), 2] = 0.05
    to_surface[len(floor) + rows[outside], axis[outside]] = np.sign(away[outside, axis[outside]]) * 0.05
    kind = np.where(np.abs(to_surface).max(axis=1) > 0.0, 2, 4)
    arrays = {
        "position": np.concatenate([floor, block]),
        "kind": kind,
        "to_surface": to_surface,
        "body": np.repeat([0, 1], [len(floor), len(block)]),
    }
    room, obstacle = render.walls(Frame(0.0, 0, arrays, SPACING, 3, {}))
    assert np.allclose(room.bounds, (0.0, 1.6, 0.0, 1.6, 0.0, 0.0), atol=1e-6)
    assert obstacle.bounds[5] == pytest.approx(0.6, abs=0.03)
    assert obstacle.bounds[4] > 0.0
    assert obstacle.bounds[0] == pytest.approx(0.5, abs=0.1)
    assert obstacle.bounds[1] == pytest.approx(1.1, abs=0.1)


def test_a_column_through_a_roof_has_nothing_of_the_roof():
    """A column of 0.6 m from under the floor to over a roof at z = 1: no wider than its foot, and the roof is there."""
    pytest.importorskip("pyvista")
    plates = lattice(20, 20, 3)
    floor, roof = plates * [1, 1, -1], plates + np.array([0.0, 0.0, 1.0])
    column = lattice(6, 6, 18) + np.array([0.7, 0.7, -0.3])
    away = column[:, :2] - 1.0
    axis, rows = np.argmax(np.abs(away), axis=1), np.arange(len(column))
    depth = 0.3 - np.abs(away[rows, axis])
    to_surface = np.zeros((len(column), 3))
    to_surface[rows, axis] = np.sign(away[rows, axis]) * depth
    free = np.abs(plates[:, :2] - 1.0).max(axis=1) > 0.3
    position = np.concatenate([floor[free], roof[free], column])
    flat = np.zeros((2 * free.sum(), 3))
    flat[:, 2] = np.concatenate([-floor[free, 2], 1.0 - roof[free, 2]])
    arrays = {
        "position": position,
        "to_surface": np.concatenate([flat, to_surface]),
        "kind": np.where(np.concatenate([np.abs(flat[:, 2]), depth]) < 0.06, 2, 4),
        "body": np.repeat([0, 1], [2 * free.sum(), len(column)]),
    }
    room, obstacle = render.walls(Frame(0.0, 0, arrays, SPACING, 3, {}))
    assert np.allclose(room.bounds, (0.0, 2.0, 0.0, 2.0, 0.0, 1.0), atol=1e-6)
    assert obstacle.bounds[0] == pytest.approx(0.7, abs=1.2 * SPACING)
    assert obstacle.bounds[1] == pytest.approx(1.3, abs=1.2 * SPACING)
    assert obstacle.bounds[5] == pytest.approx(1.5, abs=0.3 * SPACING)
