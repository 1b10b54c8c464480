"""Reading a run back: what is whole, what is cut short, and what is no run at all."""

import json
import os
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest

import spume
from run_folders import write_run
from spume.outputs import vtkhdf
from spume.results import RunFolderError
from spume.tables import read_columns


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    return write_run(tmp_path_factory.mktemp("runs") / "run")


@pytest.fixture
def folder(whole, tmp_path):
    return Path(shutil.copytree(whole, tmp_path / "run"))


def changed(folder, **values):
    file = folder / "summary.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | values))


# ------------------------------------------------------------------------------------------- whole runs


def test_frames_are_those_of_the_file(whole):
    run = spume.open(whole)
    assert (run.status, run.problems, len(run), run.dimension, run.spacing) == ("finished", [], 11, 2, 0.1)
    with vtkhdf.Reader(whole / "run.vtkhdf") as reader:
        np.testing.assert_array_equal(run.times, reader.times)
        for index in (0, 3, -1):
            expected = reader.read(index)
            for name in reader.fields:
                np.testing.assert_array_equal(run[index][name], expected[name])
            np.testing.assert_array_equal(run[index].fluid, expected["kind"] == 1)
            np.testing.assert_array_equal(run[index].wall, expected["kind"] == 2)
            np.testing.assert_allclose(run[index].speed, np.hypot(*expected["velocity"].T))
            assert run[index].time == expected.time
    assert run[3].position.shape == (len(run[3]), 2)
    assert set(run[3].fields) == set(run.fields)
    assert run.units["pressure"] == "Pa"


def test_stepping_through_time(whole):
    run = spume.open(whole)
    assert [f.time for f in run] == list(run.times)
    assert [f.index for f in run[::4]] == [0, 4, 8]
    assert run.at(0.0).index == 0
    assert run.at(run.times[7] + 0.01).index == 7
    assert run.at(1e9).index == run.at(run.times[-1]).index == 10
    with pytest.raises(IndexError, match="frame 11 of 11"):
        run[11]
    with pytest.raises(KeyError, match=r"no field 'presure'; the frames have .*pressure"):
        run[0]["presure"]


def test_a_field_is_read_only_when_asked_for(whole, monkeypatch):
    read = []
    original = vtkhdf.Reader.read
    monkeypatch.setattr(
        vtkhdf.Reader, "read", lambda self, step, fields: read.append(tuple(fields)) or original(self, step, fields)
    )
    frame = spume.open(whole)[2]
    assert read == []
    assert frame["pressure"] is frame["pressure"]
    assert read == [("pressure",)]


def test_tables_are_those_of_the_files(whole):
    pytest.importorskip("pandas")
    run = spume.open(whole)
    assert list(run.gauges) == ["level", "volume", "energy"]
    columns, units = read_columns(whole / "gauges" / "energy.csv")
    energy = run.gauges["energy"]
    assert list(energy.columns) == list(columns) == ["time", "total", "kinetic", "potential"]
    np.testing.assert_array_equal(energy["kinetic"], columns["kinetic"])
    assert energy.attrs["units"] == units == {"time": "s", "total": "J/m", "kinetic": "J/m", "potential": "J/m"}
    assert list(run.log["step"]) == list(range(1, 40))
    assert run.log.attrs["units"]["dt"] == "s"
    with pytest.raises(KeyError, match="no gauge 'depth'; the run has level, volume, energy"):
        run.gauges["depth"]


def test_references_are_in_si_units(folder):
    pytest.importorskip("pandas")
    text = (folder / "case.toml").read_text()
    (folder / "case.toml").write_text(text.replace('label = "h [m]"', "time_scale = 2.0\nscale = 10.0"))
    (series,) = spume.open(folder).reference["level"]
    given, _ = read_columns(folder / "level.csv")
    np.testing.assert_allclose(series["time"], 2.0 * given["t"])
    np.testing.assert_allclose(series["elevation"], 10.0 * given["h"])
    np.testing.assert_allclose(series["upper"], 10.0 * given["high"])
    assert series.attrs["units"] == {"time": "s", "elevation": "m", "lower": "m", "upper": "m"}
    assert series.attrs["source"] == "Nobody (1999)"


def test_case_and_comparison_are_those_of_the_run(whole):
    run = spume.open(whole)
    assert (run.case.title, run.case.spacing, run.case.gauge[0].name) == ("A tank", 0.1, "level")
    (comparison,) = run.comparisons
    assert comparison.to_json() == run.summary["comparison"][0] | {"time_label": "t [s]"}


def test_without_pandas_the_message_names_the_command(whole, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    run = spume.open(whole)
    with pytest.raises(ModuleNotFoundError, match="pip install pandas"):
        run.gauges["level"]
    with pytest.raises(ModuleNotFoundError, match="pip install pandas"):
        _ = run.log
    assert len(run.columns("level")[0]["time"]) == 26


def test_opening_loads_neither_kernels_nor_pandas(whole):
    code = f"import sys, spume; spume.open({str(whole)!r})[0].position"
    code += "; print({'quadrants', 'pandas', 'matplotlib'} & set(sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "set()\n"


# ---------------------------------------------------------------------------- runs that have no good end


def test_a_killed_run_is_told_from_one_that_computes(folder):
    changed(folder, status="running", environment={"host": socket.gethostname(), "process": os.getpid()})
    assert spume.open(folder).status == "running"
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    environment = json.loads((folder / "summary.json").read_text())["environment"] | {"process": ended.pid}
    changed(folder, environment=environment)
    run = spume.open(folder)
    assert run.status == "crashed"
    assert f"spume run --resume {folder}" in " ".join(run.problems)
    assert len(run) == 11


def test_a_run_on_another_machine_counts_as_killed_when_it_has_long_been_quiet(folder):
    changed(folder, status="running", environment={"host": "elsewhere", "process": os.getpid()})
    assert spume.open(folder).status == "running"
    for path in (*folder.iterdir(), folder):
        os.utime(path, (1e9, 1e9))
    assert spume.open(folder).status == "crashed"


def test_killed_in_the_middle_of_a_line_and_of_a_frame(folder):
    pytest.importorskip("pandas")
    for name in ("log.csv", "gauges/level.csv"):
        text = (folder / name).read_text()
        (folder / name).write_text(text[: text.rstrip("\n").rindex(",")])
    run = spume.open(folder)
    assert len(run.log) == 38
    assert len(run.gauges["level"]) == 25
    size = (folder / "run.vtkhdf").stat().st_size
    os.truncate(folder / "run.vtkhdf", size // 3)
    run = spume.open(folder)
    assert run.status == "finished"
    assert any("run.vtkhdf cannot be read" in p and "truncated file" in p for p in run.problems)
    assert len(run) == 0
    with pytest.raises(RunFolderError, match=r"no frames: run.vtkhdf cannot be read"):
        run.at(0.1)


def test_a_frame_that_lacks_rows_is_named(folder):
    with h5py.File(folder / "run.vtkhdf", "r+") as file:
        file["VTKHDF/Points"].resize(len(file["VTKHDF/Points"]) - 1, axis=0)
    run = spume.open(folder)
    assert run[9].position.shape == run[0].position.shape
    with pytest.raises(RunFolderError, match=r"field 'position' of frame 10 cannot be read .*cut short"):
        _ = run[10].position


@pytest.mark.parametrize(
    ("gone", "status", "problem"),
    [
        ("summary.json", "incomplete", "no summary.json"),
        ("case.toml", "finished", "no case.toml"),
        ("run.vtkhdf", "finished", "no run.vtkhdf"),
    ],
)
def test_what_is_missing_is_named_and_the_rest_is_there(folder, gone, status, problem):
    (folder / gone).unlink()
    run = spume.open(folder)
    assert run.status == status
    assert len(run.problems) == 1
    assert problem in run.problems[0]
    assert len(run.columns()[0]["step"]) == 39
    assert len(run) == (0 if gone == "run.vtkhdf" else 11)
    assert run.dimension == 2


def test_missing_parts_raise_what_names_them(folder):
    (folder / "case.toml").unlink()
    (folder / "log.csv").unlink()
    run = spume.open(folder)
    with pytest.raises(RunFolderError, match=r"no case.toml"):
        _ = run.case
    with pytest.raises(RunFolderError, match=r"log.csv"):
        run.columns()


def test_a_gauge_that_the_run_has_not_is_told_those_it_has(whole):
    with pytest.raises(RunFolderError, match=r"no gauge 'levle'; the run has .*level.*; did you mean 'level'\?$"):
        spume.open(whole).columns("levle")


@pytest.mark.parametrize(
    ("name", "content"),
    [("summary.json", "{"), ("summary.json", "[1]"), ("case.toml", "a = ["), ("run.vtkhdf", "nothing")],
)
def test_a_damaged_file_is_named(folder, name, content):
    (folder / name).write_text(content)
    run = spume.open(folder)
    assert any(p.startswith(name) for p in run.problems)
    assert len(run.columns("level")[0]["time"]) == 26


def test_a_reference_whose_file_is_gone_is_a_problem_not_an_end(folder):
    (folder / "level.csv").unlink()
    run = spume.open(folder)
    assert run.references == ()
    assert "the reference of gauge 'level' (level.csv) cannot be read: no such file" in run.problems[-1]


def test_an_older_version_is_named_and_read(folder):
    summary = json.loads((folder / "summary.json").read_text())
    for key in ("environment", "counts", "stage_times", "dimension"):
        del summary[key]
    (folder / "summary.json").write_text(json.dumps(summary | {"version": "0.0.1"}))
    (folder / "case.toml").write_text("of_old = 1\n" + (folder / "case.toml").read_text())
    run = spume.open(folder)
    assert (run.status, len(run), run.dimension) == ("finished", 11, 2)
    assert run.problems == [f"written by spume 0.0.1, read by spume {spume.__version__}"]
    with pytest.raises(spume.CaseError, match=r"of_old = 1.*\n.*one of spume 0.0.1"):
        _ = run.case
    assert run.document["of_old"] == 1


# ------------------------------------------------------------------------------------------ no run at all


def test_what_is_no_run_folder_is_named_for_what_it_is(whole, tmp_path):
    cases = {
        tmp_path / "nowhere": "no such folder",
        whole / "run.vtkhdf": f"a file, not a folder; name the run folder: {whole}",
        whole.parent: f"there are run folders in it: {whole}",
    }
    (tmp_path / "empty").mkdir()
    cases[tmp_path / "empty"] = "it is empty"
    other = tmp_path / "other"
    other.mkdir()
    (other / "a.txt").write_text("")
    cases[other] = r"not a run folder of Spume: it holds a.txt; a run folder holds case.toml, summary.json"
    for path, message in cases.items():
        with pytest.raises(RunFolderError, match=message):
            spume.open(path)


def test_a_case_that_was_not_run_is_incomplete(tmp_path, whole):
    shutil.copy(whole / "case.toml", tmp_path)
    run = spume.open(tmp_path)
    assert (run.status, len(run), list(run.gauge_names)) == ("incomplete", 0, [])
