"""What the page says: the numbers of the run's files, and nothing from anywhere else."""

import html
import json
import re
import shutil
import sys
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

import spume.report
from report.unpacked import unpacked
from run_folders import write_run
from spume.cli import app
from spume.outputs import vtkhdf
from spume.outputs.snapshot import FLUID, WALL, Snapshot
from spume.report import LARGEST_BYTES, ReportError, write_report
from spume.report.charts import thinned
from spume.report.particles import packed, survey
from spume.results import Results, RunFolderError
from spume.tables import read_columns

pytest.importorskip("plotly")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("runs") / "run")


@pytest.fixture
def folder(whole, tmp_path):
    return Path(shutil.copytree(whole, tmp_path / "run"))


@pytest.fixture(scope="module")
def page(whole, tmp_path_factory):
    return write_report(whole, tmp_path_factory.mktemp("page") / "report.html").read_text("utf-8")


class Elements(HTMLParser):
    """Every element with its attributes, and the text of scripts."""

    def __init__(self, text):
        super().__init__()
        self.found, self.scripts, self._script = [], {}, None
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))
        self._script = dict(attrs).get("id", "code") if tag == "script" else None

    def handle_endtag(self, tag):
        self._script = None

    def handle_data(self, data):
        if self._script:
            self.scripts[self._script] = self.scripts.get(self._script, "") + data


def data_of(text):
    return json.loads(Elements(text).scripts["report"])


def cells_of(text, row):
    """The whole values of the cells in a table's row."""
    line = re.search(rf"<tr><th scope='row'>{re.escape(row)}</th>(.*?)</tr>", text).group(1)
    return [float(v) for v in re.findall(r'data-value="([^"]*)"', line)]


def words(text):
    return html.unescape(re.sub(r"<[^>]+>", " ", re.sub(r"<(script|style).*?</\1>", " ", text, flags=re.S)))


# ----------------------------------------------------------------------------------------- self-contained


def test_nothing_is_fetched(page):
    elements = Elements(page)
    for tag, attributes in elements.found:
        assert "src" not in attributes, tag
        assert attributes.get("href", "#").startswith(("#", "data:")), tag
    policy = next(a["content"] for t, a in elements.found if a.get("http-equiv") == "Content-Security-Policy")
    assert policy.startswith("default-src 'none';")
    assert "http" not in policy
    own = elements.scripts["code"]
    assert not re.search(r"https?:|fetch\(|XMLHttpRequest|import\(|@import|url\(", own + page.split("</style>")[0])


def test_a_title_cannot_end_the_script(folder):
    nasty = "</script><script>alert(1)</script><b>"
    text = (folder / "case.toml").read_text().replace("A tank", nasty)
    (folder / "case.toml").write_text(text)
    summary = json.loads((folder / "summary.json").read_text())
    (folder / "summary.json").write_text(json.dumps(summary | {"title": nasty, "reason": nasty}))
    page = write_report(folder).read_text("utf-8")
    assert nasty not in page
    assert html.escape(nasty) in page
    assert len(Elements(page).scripts) == 4


# ------------------------------------------------------------------------------------------------ numbers


def test_charts_hold_the_numbers_of_the_files(page, whole):
    charts = {chart["name"]: chart for chart in data_of(page)["charts"]}
    level, units = read_columns(whole / "gauges" / "level.csv")
    series, _ = read_columns(whole / "level.csv")
    band, measured, spume_ = charts["gauge level"]["lines"]
    assert (spume_["x"], spume_["y"]) == (list(level["time"]), list(level["elevation"]))
    assert (measured["x"], measured["y"]) == (list(series["t"]), list(series["h"]))
    assert (band["lower"], band["upper"]) == (list(series["low"]), list(series["high"]))
    assert measured["label"] == "Nobody (1999)"
    assert charts["gauge level"]["y"] == "h [m]"
    log, units = read_columns(whole / "log.csv")
    assert charts["volume"]["lines"][0]["y"] == list(log["volume"])
    assert charts["iterations"]["lines"][0]["y"] == list(log["iterations"])
    total = charts["energy"]["lines"][0]
    np.testing.assert_array_equal(total["y"], log["kinetic_energy"] + log["potential_energy"])
    assert charts["energy"]["y"] == f"energy [{units['kinetic_energy']}]" == "energy [J/m]"
    clipped = next(line for line in charts["limiters"]["lines"] if line["label"] == "clipped")
    assert clipped["y"][-1] == 36
    with vtkhdf.Reader(whole / "run.vtkhdf") as reader:
        frame = reader.read(5)
    momentum = 1000.0 * 0.1**2 * frame["velocity"][frame.fluid].sum(axis=0, dtype=float)
    assert [line["y"][5] for line in charts["momentum"]["lines"]] == pytest.approx(list(momentum), abs=1e-12)


def test_tables_hold_the_numbers_of_the_summary(page, whole):
    summary = json.loads((whole / "summary.json").read_text())
    assert cells_of(page, "steps") == [summary["steps"]] == [39]
    assert cells_of(page, "pressure iterations, mean") == [summary["pressure_iterations_mean"]]
    assert cells_of(page, "collisions") == [summary["counts"]["collisions"]]
    assert cells_of(page, "pressure") == [summary["stage_times"]["pressure"], 1.0]
    assert cells_of(page, "largest memory") == [summary["peak_memory_bytes"] / 2**20]
    c = summary["comparison"][0]
    share = c["rms"] / c["reference_range"]
    expected = [c["peak"], c["reference_peak"], c["arrival"], c["reference_arrival"], c["rms"], share, c["max_error"]]
    assert cells_of(page, "level")[:-1] == pytest.approx([v for v in expected if v is not None], rel=1e-12)
    log, _ = read_columns(whole / "log.csv")
    volume = log["volume"]
    total = log["kinetic_energy"] + log["potential_energy"]
    assert cells_of(page, "total energy [J/m]")[4:] == [total[-1] - total[0], (total[-1] - total[0]) / total[0]]
    momentum = data_of(page)["charts"][[c["name"] for c in data_of(page)["charts"]].index("momentum")]["lines"][0]["y"]
    assert cells_of(page, "momentum along x [kg m/s per m]")[:2] == [momentum[0], momentum[-1]]
    assert cells_of(page, "volume [m²]")[:4] == [volume[0], volume[-1], volume.min(), volume.max()]


def test_the_completed_case_and_the_environment_are_there(page, whole):
    text = words(page)
    assert (whole / "case.toml").read_text() in text
    environment = json.loads((whole / "summary.json").read_text())["environment"]
    assert environment["python"] in text
    assert environment["libraries"]["numpy"] in text
    assert environment["processor"] in text
    assert environment["host"] not in text.replace((whole / "case.toml").read_text(), "")


def test_particles_are_those_of_the_frames(page, whole):
    known = data_of(page)["runs"][0]["particles"]
    text = Elements(page).scripts["particles-0"]
    with vtkhdf.Reader(whole / "run.vtkhdf") as reader:
        assert known["times"] == pytest.approx(list(reader.times), rel=1e-8)
        frames = [reader.read(i) for i in range(len(reader))]
    for name, mask in (("fluid", FLUID), ("wall", WALL)):
        group = known["groups"][name]
        rows = frames[0]["kind"] == mask
        assert group["rows"] == group["all"] == rows.sum()
        gaps = unpacked(group["channels"]["gap"], group["rows"], text)
        np.testing.assert_array_equal(group["first_id"] + np.cumsum(gaps), frames[0]["id"][rows])
        for k, axis in enumerate("xy"):
            channel = group["channels"][axis]
            found = unpacked(channel, group["rows"], text)
            assert channel["frames"] == (1 if name == "wall" or axis == "x" else 11)
            for index, row in enumerate(found):
                assert np.abs(row - frames[index].position[rows, k]).max() <= 0.51 * channel["step"]
    speed = known["groups"]["fluid"]["channels"]["speed"]
    found = unpacked(speed, known["groups"]["fluid"]["rows"], text)
    for frame, row in zip(frames, found, strict=True):
        assert np.abs(row - frame.speed[frame.fluid]).max() <= 0.51 * speed["step"]
    assert "Shown: all" in page


# ----------------------------------------------------------------------------------- large and odd runs


def spiky(folder, rows=900, frames=12):
    """A run with more rows than are shown, of which another one has an extreme value in every frame."""
    folder.mkdir()
    random = np.random.default_rng(3)
    place = np.stack(np.meshgrid(*[np.arange(30)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)[:rows] * 0.1
    writer = vtkhdf.Writer(folder / "run.vtkhdf", ("velocity", "pressure", "kind", "material"))
    spikes = []
    for number in range(frames):
        pressure, position = random.normal(0.0, 1.0, rows), place.copy()
        high, low, fast, far = random.choice(np.delete(np.arange(rows), 17), 4, replace=False)
        high = high if number else 17  # shown, and gone later
        pressure[high], pressure[low] = 1000.0 + number, -500.0 - number
        velocity = random.normal(0.0, 0.1, (rows, 2))
        velocity[fast] = [30.0, 40.0]
        position[far] = [50.0, 60.0]
        spikes.append((high, low, fast, far))
        now = {
            "position": position, "velocity": velocity, "pressure": pressure, "kind": np.full(rows, FLUID),
            "material": np.zeros(rows, dtype=int), "id": np.arange(rows),
        }  # fmt: skip
        kept = np.delete(np.arange(rows), 17) if number > 5 else np.arange(rows)  # one leaves the domain
        writer.write(
            Snapshot(
                lambda name, now=now, kept=kept: now[name][kept], time=0.1 * number, step=number, dt=0.1, spacing=0.1,
                dimension=2, gravity=[0.0, -9.81], fields={"pressure": SimpleNamespace(unit="Pa", doc="", output=True)},
            )
        )  # fmt: skip
    writer.close()
    return folder, spikes


def test_extremes_of_every_frame_are_among_the_shown(tmp_path):
    folder, spikes = spiky(tmp_path / "run")
    run = Results(folder)
    seen = survey(run, 201)
    known, stream = packed(run, seen, 150)
    group, text = known["groups"]["fluid"], stream.text()
    assert group["rows"] <= 150 < group["all"] == 900
    ids = group["first_id"] + np.cumsum(unpacked(group["channels"]["gap"], group["rows"], text)[0]).astype(int)
    values = {n: unpacked(group["channels"][n], group["rows"], text) for n in ("x", "pressure", "speed", "absent")}
    for number, (high, low, fast, far) in enumerate(spikes):
        assert ids[np.argmax(values["pressure"][number])] == high
        assert ids[np.argmin(values["pressure"][number])] == low
        assert ids[np.argmax(values["speed"][number])] == fast
        assert ids[np.argmax(values["x"][number])] == far
        assert values["pressure"][number].max() == pytest.approx(
            1000.0 + number, abs=group["channels"]["pressure"]["step"]
        )
        assert values["speed"][number].max() == pytest.approx(50.0, abs=group["channels"]["speed"]["step"])
    assert seen.records["largest pressure"]["value"] == 1011.0
    assert seen.records["smallest pressure"]["time"] == pytest.approx(1.1)
    assert np.all(values["absent"].sum(axis=0) == np.where(ids == 17, 6, 0))


def test_a_page_with_fewer_particles_says_so(tmp_path, monkeypatch):
    folder, _ = spiky(tmp_path / "run")
    monkeypatch.setattr("spume.report.sample.LARGEST_COUNT", 150)
    page = write_report(folder).read_text("utf-8")
    shown = data_of(page)["runs"][0]["particles"]["groups"]["fluid"]["rows"]
    assert f"Shown: {shown} of 900 particles of fluid and wetted walls" in page
    assert "those with the extreme values of every frame are among them; all 12 frames." in page
    for name in ("summary.json", "case.toml"):
        assert f"no {name}" in words(page)


def test_a_page_that_would_be_too_large_has_fewer_frames(whole, tmp_path, monkeypatch):
    full = write_report(whole, tmp_path / "full.html").stat().st_size
    assert full < LARGEST_BYTES == 15_000_000
    monkeypatch.setattr(spume.report, "LARGEST_BYTES", full - 100)
    monkeypatch.setattr(spume.report, "_FEWEST_FRAMES", 3)
    page = write_report(whole, tmp_path / "small.html").read_text("utf-8")
    known = data_of(page)["runs"][0]["particles"]
    assert known["frames"][0] == 0
    assert known["frames"][-1] == 10
    assert len(known["frames"]) < 11
    assert f"{len(known['frames'])} of 11 frames" in page


@pytest.mark.parametrize("count", [7, 2999, 3001, 50_000])
def test_thinned_lines_keep_their_extremes(count):
    x = np.arange(float(count))
    y = np.random.default_rng(count).normal(size=count)
    y[count // 3], y[count // 2], y[count // 5] = 40.0, -40.0, np.nan
    a, b = thinned(x, y)
    assert len(a) <= 3002
    assert len(a) == count or count > 3000
    assert (np.nanmax(b), np.nanmin(b)) == (40.0, -40.0)
    np.testing.assert_array_equal(b, y[a.astype(int)])
    assert (a[0], a[-1]) == (0.0, count - 1.0)


def test_a_comparison_shows_every_run_and_where_the_cases_differ(whole, folder, tmp_path):
    text = (folder / "case.toml").read_text().replace("spacing = 0.1", "spacing = 0.2")
    (folder / "case.toml").write_text(text)
    page = write_report([whole, folder], tmp_path / "both.html").read_text("utf-8")
    data = data_of(page)
    assert len(data["runs"]) == 2
    assert data["runs"][0]["name"] != data["runs"][1]["name"]
    assert "particles-1" in Elements(page).scripts
    (level,) = [c for c in data["charts"] if c["name"] == "gauge level"]
    assert [line["label"] for line in level["lines"][2:]] == [run["name"] for run in data["runs"]]
    assert re.search(r"<tr><th scope='row'>spacing</th><td>0.1</td><td>0.2</td></tr>", page)
    assert cells_of(page, "steps") == [39, 39]


def test_a_run_without_frames_or_tables_still_has_a_page(folder):
    for name in ("run.vtkhdf", "log.csv"):
        (folder / name).unlink()
    shutil.rmtree(folder / "gauges")
    page = write_report(folder).read_text("utf-8")
    text = words(page)
    assert "There are no frames that can be shown." in text
    assert "no run.vtkhdf" in text
    assert "log.csv" in text
    assert data_of(page)["charts"] == []


def test_a_damaged_file_of_frames_is_named(folder):
    with (folder / "run.vtkhdf").open("r+b") as file:
        file.truncate(5000)
    text = words(write_report(folder).read_text("utf-8"))
    assert "run.vtkhdf cannot be read" in text


# -------------------------------------------------------------------------------------------- bad input


def test_without_plotly_the_message_names_the_command(whole, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "plotly.offline", None)
    monkeypatch.setitem(sys.modules, "plotly", None)
    with pytest.raises(ReportError, match=r'plotly, which is not installed: pip install "spume\[report\]"'):
        write_report(whole, tmp_path / "a.html")
    assert not (tmp_path / "a.html").exists()


def test_only_reports_are_replaced(folder, tmp_path):
    page = write_report(folder)
    assert page == folder / "report.html"
    assert write_report(folder) == page
    other = tmp_path / "mine.html"
    other.write_text("mine")
    with pytest.raises(ReportError, match="exists and is no report of Spume"):
        write_report(folder, other)
    assert other.read_text() == "mine"
    with pytest.raises(ReportError, match="a folder, not a file"):
        write_report(folder, tmp_path)
    with pytest.raises(RunFolderError, match="no such folder"):
        write_report(tmp_path / "nowhere")


def test_the_command(folder, tmp_path, monkeypatch):
    run = CliRunner()
    monkeypatch.chdir(tmp_path)
    answer = run.invoke(app, ["report", str(folder)])
    assert answer.exit_code == 0, answer.output
    assert f"Report: {folder}/report.html" in answer.output
    answer = run.invoke(app, ["report", str(folder), str(folder), "--open"], env={"BROWSER": "false"})
    assert answer.exit_code == 0, answer.output
    assert (tmp_path / "report.html").exists()
    (tmp_path / "other").mkdir()
    answer = run.invoke(app, ["report", str(tmp_path / "other")])
    assert answer.exit_code == 2
    assert "not a run folder of Spume: it is empty" in answer.output
