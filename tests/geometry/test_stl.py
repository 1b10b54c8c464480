"""Solids from STL files: the rows of a box, turning and moving, mistakes in files."""

import runpy
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

import spume
from spume import build
from spume.geometry import Box, Grid, Sphere, Stl, fill, wall_layers
from spume.named import CASES
from spume.problems import CaseError

BOUNDS = [[0.2, 0.3, 0.0], [0.6, 0.5, 0.4]]
BOX = Box(lower=tuple(BOUNDS[0]), upper=tuple(BOUNDS[1]))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("stl")
    box = trimesh.creation.box(bounds=BOUNDS)
    box.export(path / "box.stl")
    box.export(path / "text.stl", file_type="stl_ascii")
    inverted = box.copy()
    inverted.invert()
    inverted.export(path / "inverted.stl")
    open_box = box.copy()
    open_box.update_faces(np.arange(12) != 3)
    open_box.export(path / "hole.stl")
    large = box.copy()
    large.apply_scale(1000.0)
    large.export(path / "millimetres.stl")
    trimesh.creation.box(bounds=[[0.9, 0.2, -0.1], [0.912, 0.3, 0.3]]).export(path / "thin.stl")
    trimesh.creation.box(bounds=[[0.9, 0.2, -0.1], [0.902, 0.3, 0.3]]).export(path / "sheet.stl")
    trimesh.creation.icosphere(subdivisions=4, radius=0.5).export(path / "ball.stl")
    other = trimesh.creation.box(bounds=[[0.5, 0.3, 0.0], [0.8, 0.5, 0.4]])
    trimesh.util.concatenate([box, other]).export(path / "overlap.stl")
    (path / "empty.stl").write_bytes(b"")
    (path / "bare.stl").write_text("solid a\nendsolid a\n")
    (path / "junk.stl").write_bytes(b"PK\x03\x04" * 50)
    return path


@pytest.mark.parametrize("name", ["box.stl", "text.stl", "inverted.stl"])
@pytest.mark.parametrize("wetted", ["inside", "outside"])
def test_rows_of_a_box_are_those_of_the_shape_box(folder, name, wetted):
    grid = Grid((0.0, 0.0, 0.0), 0.05)
    drawn, said = Stl(file=folder / name).snapped(grid)
    assert said == (["its triangles looked inwards: turned round"] if name == "inverted.stl" else [])
    assert drawn.measure() == pytest.approx(BOX.measure(), rel=1e-12)
    assert drawn.surface() == pytest.approx(BOX.surface(), rel=1e-12)
    made, same = (wall_layers(shape, grid, 3, wetted=wetted) for shape in (BOX, drawn))
    assert np.array_equal(same.position, made.position)
    assert np.array_equal(same.wall, made.wall)
    assert np.array_equal(same.master, made.master)
    assert same.to_surface == pytest.approx(made.to_surface, abs=1e-12)
    assert np.array_equal(same.exposed, made.exposed)
    assert np.array_equal(fill(drawn, grid), fill(BOX, grid))


@settings(max_examples=15, deadline=None)
@given(
    angles=st.tuples(*[st.floats(-180, 180)] * 3), shift=st.tuples(*[st.floats(-1, 1)] * 3), scale=st.floats(0.1, 10)
)
def test_scaled_turned_and_moved(folder, angles, shift, scale):
    """Inside and distance of a turned drawing are those of the box at the points turned back."""
    from scipy.spatial.transform import Rotation

    drawn = Stl(file=folder / "box.stl", scale=scale, rotate_deg=angles, translate=shift)
    x = np.random.default_rng(0).uniform(-0.2, 0.9, (300, 3))  # in the file's coordinates
    turn = Rotation.from_euler("x", angles[0], degrees=True)
    turn = Rotation.from_euler("y", angles[1], degrees=True) * turn
    turn = Rotation.from_euler("z", angles[2], degrees=True) * turn
    placed = turn.apply(x * scale) + shift
    assert np.array_equal(drawn.inside(placed), BOX.inside(x))
    assert drawn.distance(placed) == pytest.approx(scale * BOX.distance(x), abs=1e-6 * scale)
    assert drawn.measure() == pytest.approx(scale**3 * BOX.measure(), rel=1e-6)
    band = drawn.distance_within(placed, 0.1 * scale)
    near = np.abs(BOX.distance(x)) < 0.099
    assert band[near] == pytest.approx(scale * BOX.distance(x)[near], abs=1e-6 * scale)
    assert np.array_equal(np.sign(band), np.sign(drawn.distance(placed)))


def test_ball_and_sphere(folder):
    drawn, sphere = Stl(file=folder / "ball.stl"), Sphere(centre=(0, 0, 0), radius=0.5)
    x = np.random.default_rng(1).uniform(-0.7, 0.7, (5000, 3))
    assert drawn.distance(x) == pytest.approx(sphere.distance(x), abs=2e-3)
    edge = np.abs(sphere.distance(x)) < 2e-3
    assert np.array_equal(drawn.inside(x)[~edge], sphere.inside(x)[~edge])
    # Lattice points lie under vertices and edges of the drawing, where a careless count goes wrong.
    centres = fill(drawn, Grid((-1.0, -1.0, -1.0), 0.125))
    assert np.abs(np.sort(centres, axis=0) + np.sort(centres, axis=0)[::-1]).max() < 1e-12
    on_axis = np.column_stack([np.zeros(9), np.zeros(9), np.linspace(-0.8, 0.8, 9)])
    assert drawn.inside(on_axis).tolist() == [abs(z) < 0.5 for z in on_axis[:, 2]]


def test_bodies_that_overlap_in_a_file_are_one(folder):
    drawn = Stl(file=folder / "overlap.stl")
    both = np.array([[0.55, 0.4, 0.2], [0.3, 0.4, 0.2], [0.7, 0.4, 0.2], [0.9, 0.4, 0.2]])
    assert drawn.inside(both).tolist() == [True, True, True, False]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("missing.stl", "no such file"),
        ("empty.stl", "no triangle"),
        ("bare.stl", "no triangle"),
        ("junk.stl", "no triangle|cannot be read"),
        ("hole.stl", "not closed: 3 of its 18 edges"),
    ],
)
def test_files_that_are_no_solid_are_refused(folder, name, words):
    with pytest.raises(CaseError, match=words):
        Stl(file=folder / name)


def drawn_case(folder, name, **keys):
    """Return the case of the house with another drawing in its place."""
    keys = {"file": folder / name, "scale": 1.0, "translate": [0.0, 0.0, 0.0], **keys}
    return spume.load("dam-break-stl", [f"body.house.shape.{k}={v}" for k, v in keys.items()])


def test_millimetres_are_named(folder):
    with pytest.raises(spume.CaseError, match=r"body\.house\.shape\.scale = 1\.0: .*millimetres\? Then scale = 0\.001"):
        drawn_case(folder, "millimetres.stl")
    with pytest.raises(spume.CaseError, match=r"drawn in metres\? Then scale = 1"):
        drawn_case(folder, "box.stl", scale=0.001)
    assert drawn_case(folder, "millimetres.stl", scale=0.001).body[1].shape.measure() == pytest.approx(0.032)


def test_a_drawing_in_centimetres_is_warned_of_before_its_walls_are_made(folder, caplog, monkeypatch):
    class WallsAreMadeError(Exception):
        pass

    def made(*_):
        raise WallsAreMadeError

    monkeypatch.setattr(build, "_body_rows", made)
    size = np.ptp(drawn_case(folder, "millimetres.stl", scale=0.001).body[1].shape.bounds(), axis=0).max()
    for ratio, warned in ((12.0, True), (8.0, False)):
        caplog.clear()
        with pytest.raises(WallsAreMadeError):
            build.initial_rows(drawn_case(folder, "millimetres.stl", scale=0.001 * ratio * 1.6 / size))
        assert ("house.shape.scale: the drawing is 19.2 m long, the rest of the case 1.6 m" in caplog.text) == warned
        assert ("is it in centimetres or millimetres? Then scale =" in caplog.text) == warned


def test_thin_parts_are_named(folder, caplog):
    with pytest.raises(spume.CaseError, match=r"0\.012 m thick at"):  # the waters beside it would see each other
        build.initial_rows(drawn_case(folder, "thin.stl"))
    assert "parts thinner than 2 spacings" in caplog.text
    assert "choose spacing = 0.006" in caplog.text
    with pytest.raises(
        spume.CaseError, match=r"holds no particle: choose spacing.*of the shell of a tank, draw the room inside"
    ):
        build.initial_rows(drawn_case(folder, "sheet.stl"))


def test_the_house_is_not_called_thin(caplog):
    build.initial_rows(spume.load("dam-break-stl"))
    assert caplog.text == ""


def test_too_fine_a_spacing_is_refused_before_anything_is_filled(folder):
    case = drawn_case(folder, "box.stl").model_copy(update={"spacing": 1e-5})
    with pytest.raises(spume.CaseError, match="particles need about"):
        build.initial_rows(case)


def test_shipped_house_is_what_the_script_makes(tmp_path):
    script = runpy.run_path(str(Path(__file__).parent / "make_house.py"))
    script["write"](tmp_path / "house.stl")
    shipped, made = (Stl(file=file) for file in (CASES / "dam-break-stl" / "house.stl", tmp_path / "house.stl"))
    assert shipped.bounds()[0] == pytest.approx(made.bounds()[0])
    assert shipped.bounds()[1] == pytest.approx(made.bounds()[1])
    assert shipped.measure() == pytest.approx(made.measure(), rel=1e-9)
    assert shipped.measure() == pytest.approx(160 * 200 * (240 + 80 / 2), rel=1e-6)


def test_case_reads_its_own_text_again(tmp_path):
    case = spume.load("dam-break-stl")
    (tmp_path / "again.toml").write_text(case.to_toml(), encoding="utf-8")
    assert spume.load(tmp_path / "again.toml") == case
