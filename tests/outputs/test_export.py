"""spume export: files that other programs read hold the numbers of the frame."""

import numpy as np
import pytest
from typer.testing import CliRunner

import spume
from run_folders import write_run
from spume.cli import app
from spume.outputs.export import columns_of


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("export") / "run")


def call(*words):
    result = CliRunner().invoke(app, [str(word) for word in words], env={"COLUMNS": "300"})
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def test_csv_has_units_and_every_row(run, tmp_path):
    result = call("export", run, "--time", "0.2", "--field", "velocity", "--field", "kind", "--out", tmp_path)
    assert result.exit_code == 0, result.output
    frame = spume.open(run).at(0.2)
    file = tmp_path / f"frame-{frame.index:04d}.csv"
    lines = file.read_text(encoding="utf-8").splitlines()
    assert lines[0].startswith("# t = 0.20")
    assert lines[1] == "x [m],y [m],velocity_x [1],velocity_y [1],kind [1]"
    read = np.loadtxt(file, delimiter=",", skiprows=2)
    assert np.allclose(read[:, :2], frame.position)
    assert np.array_equal(read[:, 4], frame["kind"])
    assert "." not in lines[2].split(",")[4]  # a whole number


def test_columns_have_the_units_of_the_fields(run):
    assert "pressure [Pa]" in columns_of(spume.open(run)[0])


def test_vtu_and_npz_of_all_frames(run, tmp_path):
    meshio = pytest.importorskip("meshio")
    assert call("export", run, "--format", "vtu", "--out", tmp_path).exit_code == 0
    assert call("export", run, "--format", "npz", "--out", tmp_path).exit_code == 0
    results = spume.open(run)
    assert len(list(tmp_path.glob("*.vtu"))) == len(list(tmp_path.glob("*.npz"))) == len(results)
    read = meshio.read(tmp_path / "frame-0004.vtu")
    assert np.allclose(read.point_data["pressure"], results[4]["pressure"])
    with np.load(tmp_path / "frame-0004.npz") as arrays:
        assert np.array_equal(arrays["position"], results[4].position)
        assert float(arrays["time"]) == results[4].time


def test_the_surface_of_the_water_as_a_mesh(tmp_path):
    trimesh = pytest.importorskip("trimesh")
    pytest.importorskip("pyvista")
    folder = write_run(tmp_path / "run", width=0.4)
    assert call("export", folder, "--format", "ply", "--time", "0").exit_code == 0
    mesh = trimesh.load(folder / "export" / "frame-0000.ply")
    # 1.0 x 0.4 x 0.5 m, coarse and a quarter of a spacing (0.025 m) off the walls.
    assert 0.13 < mesh.volume < 0.2
    assert np.all(mesh.bounds[1] <= [1.0, 0.4, 0.6])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--format", "docx"), "format = 'docx': one of csv, npz, vtu (particles), ply, stl, vtp, obj"),
        (("--field", "presure"), "field = 'presure': one of position"),
        (("--format", "stl"), "a surface needs a 3D run"),
    ],
)
def test_bad_input_is_named(run, tmp_path, words, message):
    result = call("export", run, "--out", tmp_path, *words)
    assert (result.exit_code, message in " ".join(result.output.split())) == (2, True), result.output
