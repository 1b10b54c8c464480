"""spume plot: what is drawn, and that the diagrams hold the numbers that they claim to show."""

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

import spume
from run_folders import write_run
from spume.cli import app
from spume.outputs import figures, pictures, section, vtkhdf


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("plot") / "run")


def call(*words):
    result = CliRunner().invoke(app, [str(word) for word in words], env={"COLUMNS": "300"})
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def test_everything_is_drawn_unasked(run, tmp_path):
    result = call("plot", run, "--out", tmp_path / "made")
    assert result.exit_code == 0, result.output
    made = {path.name for path in (tmp_path / "made").iterdir()}
    assert made == {
        "snapshots.png", "gauge-level.png", "gauge-volume.png", "gauge-energy.png", "space-time-elevation.png",
    }  # fmt: skip
    for path in (tmp_path / "made").iterdir():
        assert np.asarray(Image.open(path).convert("L")).std() > 5, path  # not blank


def test_only_what_is_named_is_drawn(run, tmp_path):
    call("plot", run, "--out", tmp_path, "--gauge", "level", "--format", "svg")
    assert [path.name for path in tmp_path.iterdir()] == ["gauge-level.svg"]
    assert "Nobody (1999)" in (tmp_path / "gauge-level.svg").read_text(encoding="utf-8")


def test_a_snapshot_is_that_of_the_nearest_time(run, tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(figures.pictures, "draw_frames", lambda chosen, path, *_: drawn.extend(chosen) or path)
    call("plot", run, "--out", tmp_path, "--time", "0.21", "--time", "0.4", "--time", "0.39")
    results = spume.open(run)
    assert [frame.time for frame in drawn] == [results.at(0.21).time, results.at(0.4).time]


TWO_FLUIDS = """\
spacing = 0.1
[time]
end = 1.0
[[fluid]]
name = "water"
shape = { kind = "box", lower = [0.0, 0.0], upper = [1.0, 0.5] }
[[fluid]]
name = "oil"
density = 850.0
shape = { kind = "box", lower = [0.0, 0.5], upper = [1.0, 1.0] }
[[body]]
name = "tank"
kind = "wall"
shape = { kind = "tank", lower = [0.0, 0.0], upper = [1.0, 1.5] }
[output]
colour = "material"
"""


def test_fluids_have_a_colour_each_and_the_scale_names_them(tmp_path):
    x = (np.stack(np.meshgrid(np.arange(10), np.arange(6), indexing="ij"), axis=-1).reshape(-1, 2) + 0.5) * 0.1
    material = (x[:, 1] > 0.3).astype(int)
    arrays = {"position": x, "kind": np.ones(len(x), dtype=int), "material": material}
    frame = vtkhdf.Frame(0.0, 0, arrays, 0.1, 2, {})
    settings = pictures.OutputSettings(colour="material")
    figure = pictures.frames_figure([frame], settings, fluids=["water", "light oil"])
    labels = [text.get_text() for text in figure.axes[-1].get_yticklabels()]
    assert labels == ["water", "light oil"]
    figure.savefig(tmp_path / "p.png")
    image = np.asarray(Image.open(tmp_path / "p.png").convert("RGB"))
    found, count = np.unique(image.reshape(-1, 3), axis=0, return_counts=True)
    frequent = {tuple(colour) for colour in found[count > 1000].tolist()}
    assert {(0x00, 0x72, 0xB2), (0xE6, 0x9F, 0x00)} <= frequent
    one = pictures.view_of([frame], settings)
    assert (one.classes, one.low, one.high) == (("0", "1"), -0.5, 1.5)
    assert pictures.view_of([frame], settings.model_copy(update={"colour_range": (0.0, 3.0)})).classes == ()


def test_the_picture_of_a_check_shows_fluids_where_the_case_asks_for_them(tmp_path):
    (tmp_path / "case.toml").write_text(TWO_FLUIDS, encoding="utf-8")
    result = call("check", tmp_path / "case.toml", "--out", tmp_path / "p.png")
    assert result.exit_code == 0, result.output
    image = np.asarray(Image.open(tmp_path / "p.png").convert("RGB"), dtype=int)
    assert (image[:, :, 0] > image[:, :, 2] + 100).mean() > 0.1  # oil, orange
    assert (image[:, :, 2] > image[:, :, 0] + 100).mean() > 0.1  # water, blue


def test_a_film_takes_any_painter_and_tells_how_far_it_is(run, tmp_path):
    painted, told = [], []

    def painter(frame, view, shape, fine):
        painted.append(frame.time)
        return np.full((*shape, 3), 20 * len(painted), dtype=np.uint8)

    with vtkhdf.Reader(run / "run.vtkhdf") as reader:
        path = pictures.animate(
            reader, tmp_path / "film.gif", dpi=40, painter=painter, told=lambda done, of: told.append((done, of))
        )
        assert painted == reader.times.tolist()
    assert told == [(i, len(painted)) for i in range(len(painted))]
    film = Image.open(path)
    assert film.n_frames == len(painted)
    film.seek(5)
    inside = np.asarray(film.convert("L"))[film.height // 2, film.width // 3]
    assert abs(int(inside) - 120) < 8


def test_the_elevation_along_a_line_is_that_of_the_water(run):
    results = spume.open(run)
    diagram = section.elevation_along(list(results), np.array([0.0]), np.array([1.0]), results.spacing)
    inside = (diagram.place > 0.25) & (diagram.place < 0.75)
    expected = 0.5 + 0.02 * np.sin(10.0 * diagram.time)
    # A tenth of a spacing: the surface is where the filled part of space is one half.
    assert np.abs(diagram.values[:, inside] - expected[:, None]).max() < 0.1 * results.spacing
    assert (diagram.quantity, diagram.unit, diagram.axis, diagram.vertical) == ("elevation", "m", "x", False)


def test_there_is_no_elevation_in_a_body_that_stands_in_the_water():
    """A hollow block from x = 1 to 2.4, 0.8 high, on a floor at y = 0; water 0.3 deep before it, nothing behind."""
    l0 = 0.1

    def cells(lower, upper):
        axes = [np.arange(a + 0.5 * l0, b, l0) for a, b in zip(lower, upper, strict=True)]
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)

    water, floor, block = cells((0, 0), (1, 0.3)), cells((0, -0.3), (4, 0)), cells((1, 0), (2.4, 0.8))
    ways = np.column_stack([block[:, 0] - 1.0, 2.4 - block[:, 0], 0.8 - block[:, 1]])
    nearest, deep = ways.argmin(axis=1), ways.min(axis=1)
    up = np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, 1.0]])[nearest] * deep[:, None]
    hull = deep < 0.3
    to_surface = np.concatenate([0.0 * water, np.column_stack([0.0 * floor[:, 0], -floor[:, 1]]), up[hull]])
    position = np.concatenate([water, floor, block[hull]])
    kind = np.where(np.linalg.norm(to_surface, axis=1) < 0.06, 2, 4)
    kind[: len(water)] = 1
    frame = vtkhdf.Frame(0.0, 0, {"position": position, "kind": kind, "to_surface": to_surface}, l0, 2, {})
    diagram = section.elevation_along([frame], np.array([0.5]), np.array([3.5]), l0)
    nothing = np.isnan(diagram.values[0])
    assert np.array_equal(nothing, (diagram.place > 1.01) & (diagram.place < 2.39))
    assert diagram.values[0][diagram.place < 0.8] == pytest.approx(0.3, abs=0.05 * l0)
    assert diagram.values[0][diagram.place > 2.6] == pytest.approx(0.0, abs=0.05 * l0)


def test_the_pressure_along_a_line_is_that_of_water_at_rest(run):
    results = spume.open(run)
    diagram = section.pressure_along([results[0]], np.array([0.5, 0.05]), np.array([0.5, 0.4]), results.spacing)
    assert diagram.vertical
    assert np.allclose(diagram.values[0], 1000.0 * 9.81 * (0.5 - diagram.place), rtol=1e-4)


def test_the_diagram_of_gauges_is_linear_between_them():
    line = [("a", np.array([2.0, 0.0])), ("b", np.array([2.0, 0.1])), ("c", np.array([2.0, 0.4]))]
    t = np.linspace(0.0, 1.0, 21)
    series = {"a": (t, 0.0 * t), "b": (t, 10.0 * t), "c": (t, 40.0 * t)}
    diagram = section.between_gauges(line, series, "pressure", "Pa", 2)
    assert (diagram.axis, diagram.vertical, diagram.note) == ("y", True, "at x = 2 m; linear between the gauges")
    assert np.allclose(diagram.values, 100.0 * diagram.place * diagram.time[:, None])
    assert diagram.marks.tolist() == [0.0, 0.1, 0.4]


@pytest.mark.parametrize(
    ("places", "expected"),
    [
        ([[0, 0], [0, 1], [0, 3], [1, 1]], [0, 1, 2]),
        ([[0, 3], [0, 1], [0, 0]], [0, 1, 2]),
        ([[0, 0], [1, 1], [0, 1], [0, 2]], [0, 2, 3]),
        ([[0, 0], [1, 1], [5, 0], [2, 2], [3, 3]], [0, 1, 3, 4]),
        ([[0, 0], [0, 1], [1, 1]], []),
        ([[0, 0], [0, 0], [0, 0]], []),
    ],
)
def test_the_longest_line_of_gauges_is_found(places, expected):
    gauges = [{"name": str(i), "kind": "pressure", "at": [float(v) for v in at]} for i, at in enumerate(places)]
    others = [{"name": "x", "kind": "elevation", "at": [0.0]}, {"name": "y", "kind": "energy"}]
    found = [int(name) for name, _ in section.gauges_in_line([*gauges, *others], "pressure")]
    assert sorted(found) == expected


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--gauge", "levle"), "gauge = 'levle': one of level, volume, energy; did you mean 'level'?"),
        (("--colour", "presure"), "did you mean 'pressure'?"),
        (("--map", "jet"), "map = 'jet': one of water"),
        (("--format", "bmp"), "format = 'bmp': one of png, pdf, svg"),
        (("--line", "0,0"), "two points as X,Y:X,Y"),
        (("--line", "0,0,0:1,0,0"), "two different points of 2 numbers each, for the run is 2D"),
        (("--line", "0,0:0,0"), "two different points"),
        (("--range", "1"), "requires 2 arguments"),
    ],
)
def test_bad_input_is_named(run, tmp_path, words, message):
    result = call("plot", run, "--out", tmp_path / "none", *words)
    assert (result.exit_code, message in " ".join(result.output.split())) == (2, True), result.output
    assert not list(tmp_path.rglob("*.png"))


def test_what_is_no_run_folder(tmp_path):
    result = call("plot", tmp_path)
    assert (result.exit_code, "not a run folder of Spume" in result.output) == (2, True)
