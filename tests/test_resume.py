"""Runs that are interrupted, killed or starved of disk, and continued: the same bits as without."""

import json
import logging
import os
import shutil
import signal
import subprocess
import sys
from dataclasses import replace

import h5py
import numpy as np
import pytest

import spume
from spume import kernels
from spume.outputs import OutputSettings, checkpoint, summary, vtkhdf
from spume.outputs.disk import NotWritten
from spume.outputs.gauges import Elevation, Volume
from spume.progress import Progress, seconds_of
from spume.run import CHANGEABLE, _Limit, run
from spume.schemes.air.adiabatic import Adiabatic
from spume.schemes.laplacian.distance import Distance
from spume.schemes.turbulence.smagorinsky import Smagorinsky
from spume.schemes.viscosity.explicit import Explicit
from spume.schemes.wall_function.power_law import PowerLaw
from spume.steps.predict_move_project import PredictMoveProject
from spume.steps.project_in_place import ProjectInPlace
from tanks import column, dam_break

END = 0.12
EDDIES = Explicit(laplacian=Distance(), turbulence=Smagorinsky(constant=0.25), wall_function=PowerLaw())


def case_of(end=END, step=None, **output):
    """A dam break with a gauge of each kind, and frames that hold a field which no step carries on."""
    fields = ("velocity", "pressure", "number_density", "free_surface", "kind", "acceleration")
    settings = {"interval": 0.01, "pictures": False, "fields": fields, "checkpoint_interval": 0.0} | output
    return dam_break(cells=(6, 8), length=14, step=step).model_copy(
        update={
            "time": spume.Time(end=end),
            "threads": 1,
            "gauge": (Elevation(name="level", at=(0.05,), interval=0.003), Volume(name="volume")),
            "output": OutputSettings(**settings),
        }
    )


def limited_by_eddies():
    """A dam break of a liquid so viscous that the eddies' part of the viscosity sets the time step."""
    case = case_of(end=1.0, step=ProjectInPlace(viscosity=EDDIES))
    (liquid,) = case.fluid
    return case.model_copy(update={"fluid": (liquid.model_copy(update={"viscosity": 0.05}),)})


def with_a_bubble():
    """Water at rest with a round hole in it, whose air is compressed and swings."""
    case = column(l0=0.02, cells=(20, 20), step=ProjectInPlace(air=Adiabatic()))
    (liquid,) = case.fluid
    hollow = spume.Difference(of=liquid.shape, without=[spume.Sphere(centre=[0.2, 0.2], radius=0.09)])
    return case.model_copy(update={"fluid": (liquid.model_copy(update={"shape": hollow}),)})


def at_step(monkeypatch, step, act):
    """Let something happen after a step and its outputs."""
    plain = Progress.step

    def stepped(self, simulation):
        plain(self, simulation)
        if simulation.step_index == step:
            act()

    monkeypatch.setattr(Progress, "step", stepped)


def terminate():
    os.kill(os.getpid(), signal.SIGTERM)


def assert_same(one, other):
    """Final states, tables and frames of two run folders, bit by bit."""
    a, b = checkpoint.read(one), checkpoint.read(other)
    assert (a.step, a.time, a.numbers["list"], a.numbers["acceleration"]) == (
        b.step, b.time, b.numbers["list"], b.numbers["acceleration"],
    )  # fmt: skip
    assert a.arrays.keys() == b.arrays.keys()
    for name in a.arrays:
        assert a.arrays[name].tobytes() == b.arrays[name].tobytes(), name
    for table in ("log.csv", "gauges/level.csv", "gauges/volume.csv"):
        assert (one / table).read_bytes() == (other / table).read_bytes(), table
    with vtkhdf.Reader(one / "run.vtkhdf") as f, vtkhdf.Reader(other / "run.vtkhdf") as g:
        assert f.times.tolist() == g.times.tolist()
        for k in range(len(f)):
            x, y = f.read(k), g.read(k)
            assert all(x[name].tobytes() == y[name].tobytes() for name in x.arrays), k


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The folder of a run that nothing interrupts and that writes no checkpoint but the first and the last."""
    folder = tmp_path_factory.mktemp("whole") / "run"
    run(case_of(checkpoint_interval=600.0), folder)
    return folder


@pytest.fixture(scope="module")
def stopped(tmp_path_factory):
    """The folder of the same run, stopped by SIGTERM after eight steps."""
    with pytest.MonkeyPatch.context() as patch:
        at_step(patch, 8, terminate)
        folder = tmp_path_factory.mktemp("stopped") / "run"
        assert run(case_of(), folder).status == "interrupted"
    return folder


@pytest.fixture
def copy(stopped, tmp_path):
    return shutil.copytree(stopped, tmp_path / "run")


def test_a_run_that_is_stopped_and_continued_gives_the_same_bits(whole, copy):
    assert summary.read(copy)["reason"] == "stopped by SIGTERM"
    result = spume.resume(copy)
    assert result.status == "finished"
    assert_same(whole, copy)
    a, b = summary.read(whole), summary.read(copy)
    assert (a["sessions"], b["sessions"]) == (1, 2)
    same = ("steps", "pressure_iterations_mean", "pressure_iterations_max", "volume_drift", "counts", "particles_total")
    assert {k: a[k] for k in same} == {k: b[k] for k in same}
    assert b["wall_time"] > b["wall_time_steps"] > 0.0


def test_and_so_does_one_of_the_other_algorithm_that_is_stopped_twice(monkeypatch, tmp_path):
    case = case_of(step=PredictMoveProject(), end=0.04)
    run(case, tmp_path / "whole")
    for step in (3, 9):
        with monkeypatch.context() as patch:
            at_step(patch, step, terminate)
            ended = run(case, tmp_path / "run") if step == 3 else spume.resume(tmp_path / "run")
        assert (ended.status, ended.simulation.step_index) == ("interrupted", step)
    assert spume.resume(tmp_path / "run").status == "finished"
    assert_same(tmp_path / "whole", tmp_path / "run")
    assert summary.read(tmp_path / "run")["sessions"] == 3


def poisoned(simulation, saved):
    """Fill every field that is not among the saved ones: NaN, or a wrong number."""
    for name, field in simulation.particles.fields.items():
        if f"particles/{name}" not in saved:
            array = simulation.particles[name]
            values = np.full_like(kernels.host(array), np.nan if field.dtype is float else 1)
            array.from_numpy(values)
    assert np.isnan(simulation.fetch("number_density")).all()


@pytest.mark.parametrize(
    ("case", "steps"),
    [
        (case_of(end=1.0), 7),
        (case_of(end=1.0, step=PredictMoveProject()), 7),
        (limited_by_eddies(), 7),
        (with_a_bubble(), 7),
        (column(disturbance=0.1), 12),  # nearly at rest: lists serve many steps
    ],
    ids=["project-in-place", "predict-move-project", "eddies", "air", "at-rest"],
)
def test_a_step_reads_nothing_that_a_checkpoint_does_not_hold(case, steps):
    """Every field that is not saved is filled with NaN: the steps that follow are the same bits."""
    first = case.build(threads=1)
    for _ in range(steps):
        first.advance()
    arrays, numbers = first.state()
    second = case.build(threads=1)
    second.restore(arrays, numbers)
    poisoned(second, arrays)
    for _ in range(12):
        first.advance()
        second.advance()
    assert first.domain.voids.air == second.domain.voids.air
    assert first.domain.pairs.builds == second.domain.pairs.builds
    a, b = first.state()[0], second.state()[0]
    assert all(a[name].tobytes() == b[name].tobytes() for name in a)
    assert (first.time, first.dt) == (second.time, second.dt)


def test_a_list_in_the_midst_of_its_life_is_made_again():
    """The first step after a checkpoint sees the pairs, in the order, of the list that was there."""
    case = column(disturbance=0.1)
    simulation = case.build(threads=1)
    mine = simulation.domain.pairs.list
    while mine._updates < 2 or mine.builds < 2:
        simulation.advance()
    again = case.build(threads=1)
    again.restore(*simulation.state())
    other = again.domain.pairs.list
    assert np.abs(again.fetch("position") - kernels.host(other._built)[: again.particles.count]).max() > 0.0
    for row in range(simulation.particles.count):
        found = []
        for pairs in (mine, other):
            start, length = kernels.host(pairs.start)[row], kernels.host(pairs.length)[row]
            found.append(kernels.host(pairs.chunks[0].neighbour)[start : start + length].tolist())
        assert found[0] == found[1]


def test_writing_changes_nothing_in_the_trajectory(whole, tmp_path):
    """A run with frames, gauges and a checkpoint at every step against one that only advances."""
    simulation = case_of().build(threads=1)
    simulation.run()
    run(case_of(interval=1e-4), tmp_path / "busy")
    a, b, c = simulation.state()[0], checkpoint.read(tmp_path / "busy").arrays, checkpoint.read(whole).arrays
    assert all(a[name].tobytes() == b[name].tobytes() == c[name].tobytes() for name in a)


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no SIGKILL")
def test_a_run_that_is_killed_goes_on(whole, tmp_path):
    """Killed at two instants, the second in the run that continues the first; 20 random ones are in validation/."""
    folder = tmp_path / "run"
    code = (
        "import os, signal, sys\n"
        "sys.path.insert(0, {tests!r})\n"
        "from test_resume import case_of\n"
        "import spume\n"
        "from spume.progress import Progress, seconds_of\n"
        "from spume.run import CHANGEABLE, _Limit, run\n"
        "plain = Progress.step\n"
        "def step(self, simulation):\n"
        "    plain(self, simulation)\n"
        "    if simulation.step_index == {step}: os.kill(os.getpid(), signal.SIGKILL)\n"
        "Progress.step = step\n"
        "{what}\n"
    )
    tests = os.path.dirname(__file__)
    for step, what in ((5, f"run(case_of(), {str(folder)!r})"), (11, f"spume.resume({str(folder)!r})")):
        text = code.format(tests=tests, step=step, what=what)
        ended = subprocess.run([sys.executable, "-c", text], capture_output=True, text=True)
        assert ended.returncode == -signal.SIGKILL, ended.stderr
        assert summary.read(folder)["status"] == "running"
    spume.resume(folder)
    assert_same(whole, folder)


# ------------------------------------------------------------------------------------------ full disks


def test_a_full_disk_stops_the_run_and_spares_the_checkpoint(whole, monkeypatch, tmp_path):
    folder = tmp_path / "run"
    usage = shutil.disk_usage
    with monkeypatch.context() as patch:
        full = lambda path: usage(path)._replace(free=100_000)  # noqa: E731
        at_step(patch, 6, lambda: patch.setattr("spume.outputs.disk.shutil.disk_usage", full))
        with pytest.raises(NotWritten, match="No space left on device"):
            run(case_of(), folder)
    said = summary.read(folder)
    assert said["status"] == "interrupted"
    reserve = "bytes and a reserve of 262,144 for the last lines of tables"
    assert f"{reserve} are needed, 100,000 are free" in said["reason"]
    assert checkpoint.read(folder).step <= 6
    assert not list(folder.glob("*.partial"))
    spume.resume(folder)
    assert_same(whole, folder)


def test_a_disk_that_fails_in_the_midst_of_a_checkpoint_spares_the_one_before(copy, monkeypatch):
    before = checkpoint.read(copy)
    room = [20_000]
    write = os.write

    def limited(descriptor, data):
        room[0] -= len(data)
        if room[0] < 0:
            raise OSError(28, "No space left on device")
        return write(descriptor, data)

    with monkeypatch.context() as patch:
        patch.setattr("spume.outputs.disk.os.write", limited)
        with pytest.raises(OSError, match="No space left"):
            checkpoint.write(copy / checkpoint.FILE, before)
    assert room[0] < 0
    assert checkpoint.read(copy).time == before.time
    assert not list(copy.glob("*.partial"))


def test_frames_that_a_full_disk_cut_short_are_kept_aside(copy):
    path = copy / "run.vtkhdf"
    path.write_bytes(path.read_bytes()[:-5000])
    assert spume.resume(copy).status == "finished"
    assert (copy / "run.vtkhdf.damaged").exists()
    with vtkhdf.Reader(path) as frames:
        assert frames.times[-1] == pytest.approx(END)


# ------------------------------------------------------------------------- what cannot be continued


def refused(folder, words, *overrides):
    with pytest.raises(checkpoint.CheckpointError) as caught:
        spume.resume(folder, overrides)
    assert words in str(caught.value), str(caught.value)


def change(folder, act):
    with h5py.File(folder / checkpoint.FILE, "r+") as file:
        act(file)


def test_what_cannot_be_continued_says_so(copy, whole, tmp_path):
    refused(tmp_path / "nowhere", "no such run folder")
    (tmp_path / "empty").mkdir()
    refused(tmp_path / "empty", "neither case.toml nor checkpoint.h5 is in it")
    refused(whole, "this run is finished, at t = 0.12 s; to go on: spume run --resume")
    early = "--set time.end=0.05: lies before the time that the run has reached, t = 0.12 s"
    refused(whole, early, "time.end=0.05")
    refused(copy, "fluid.0.density = 900.0: was 1000.0", "fluid.water.density=900")
    refused(copy, "a run that is continued may change only time.end, time.courant", "spacing=0.03")
    assert "density = 1000.0" in (copy / "case.toml").read_text(), "a refused change must leave no trace"
    (copy / checkpoint.FILE).rename(tmp_path / "kept")
    refused(
        copy, "no checkpoint.h5: the run ended before its first one, or wrote none; start the case again: spume run"
    )


def test_keys_that_a_case_had_in_an_earlier_version_are_no_change(copy):
    """Completed cases held a weight and a radius of what sums nothing."""
    now, before = (
        'turbulence = { name = "none" }',
        'turbulence = { name = "none", weight = { name = "inverse" }, re = 2.1 }',
    )
    saved = checkpoint.read(copy)
    assert now in saved.case
    checkpoint.write(copy / checkpoint.FILE, replace(saved, case=saved.case.replace(now, before)))
    assert spume.resume(copy).status == "finished"


def test_what_may_be_changed_are_keys_of_a_case(copy):
    case = spume.load(copy)
    for key in CHANGEABLE:
        table, _, name = key.rpartition(".")
        assert name in type(getattr(case, table) if table else case).model_fields, key


def test_a_continued_run_may_be_looked_at_from_elsewhere(copy):
    assert spume.resume(copy, ["output.view_deg=[-30.0, 20.0]"]).status == "finished"


def test_damaged_checkpoints_say_so(copy):
    path = copy / checkpoint.FILE
    good = path.read_bytes()

    def flip(file):
        file["particles/velocity"][3, 0] += 1.0

    change(copy, flip)
    refused(copy, "the checksum of particles/velocity is wrong); start the case again: spume run")
    for text in (good[: len(good) // 2], b"", b"nonsense" * 1000):
        path.write_bytes(text)
        refused(copy, "damaged and cannot be read")
    path.write_bytes(good)
    change(copy, lambda file: file.attrs.modify("format", 99))
    refused(copy, "in format 99; this is spume")


def test_another_version_or_fewer_threads_are_warned_of(copy, caplog):
    log = logging.getLogger("spume")
    log.addHandler(caplog.handler)
    change(copy, lambda file: (file.attrs.modify("spume", "0.0.9"), file.attrs.modify("threads", 2)))
    spume.resume(copy, threads=1)
    log.removeHandler(caplog.handler)
    assert "version of Spume was 0.0.9, is " in caplog.text
    assert "threads was 2, is 1: the run goes on, but not bit by bit" in caplog.text


def test_a_run_that_failed_is_continued_with_a_warning(copy, caplog):
    path = copy / summary.FILE
    said = summary.read(copy) | {"status": "failed", "reason": "too fast", "simulated_time": 0.25}
    path.write_text(json.dumps(said), encoding="utf-8")
    log = logging.getLogger("spume")
    log.addHandler(caplog.handler)
    again = shutil.copytree(copy, copy.with_name("again"))
    spume.resume(again, ["time.courant=0.1"])
    assert "this run failed" not in caplog.text
    spume.resume(copy)
    log.removeHandler(caplog.handler)
    assert "this run failed at t = 0.25 s (too fast); it will fail again unless time.courant, " in caplog.text


def test_a_finished_run_is_extended(whole, tmp_path):
    folder = shutil.copytree(whole, tmp_path / "run")
    result = spume.resume(folder, ["time.end=0.14"])
    assert result.simulation.time == pytest.approx(0.14)
    assert "end = 0.14" in (folder / "case.toml").read_text()
    lines = (folder / "log.csv").read_text().splitlines()
    assert len(lines) == result.simulation.step_index + 1
    with vtkhdf.Reader(folder / "run.vtkhdf") as frames:
        assert np.all(np.diff(frames.times) > 0.0)
        assert frames.times[-1] == pytest.approx(0.14)


# ------------------------------------------------------------------------------------------ wall time


def test_a_run_stops_before_its_wall_time_is_over(whole, tmp_path):
    folder = tmp_path / "run"
    ended = run(case_of(), folder, max_wall_time=1e-3)
    assert (ended.status, ended.simulation.step_index) == ("interrupted", 0)
    assert summary.read(folder)["reason"] == "the wall time of 0.001 s is used up"
    assert spume.resume(folder, max_wall_time=3600.0).status == "finished"
    assert_same(whole, folder)


def test_early_in_a_run_checkpoints_come_sooner(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("spume.outputs.checkpoint.time.monotonic", lambda: now[0])

    def instants(interval, seconds):
        now[0], found = 0.0, []
        kept = checkpoint.Checkpoint(spume.outputs.OutputSettings(checkpoint_interval=interval))
        kept.seconds = seconds
        kept._wait()
        while len(found) < 40:
            now[0] = kept._next
            found.append(now[0])
            kept._wait()
        return np.array(found)

    usual = instants(600.0, 0.01)
    assert usual[:4].tolist() == [5.0, 10.0, 15.0, 20.0]
    assert np.all(np.diff(usual) <= np.maximum(5.0, 0.25 * usual[:-1]) + 1e-9), "a fifth of the run is lost at most"
    assert np.diff(usual)[-1] == 600.0
    assert instants(2.0, 0.01)[:3].tolist() == [2.0, 4.0, 6.0], "never later than the interval"
    assert np.all(np.diff(instants(600.0, 1.0)) >= 20.0), "a twentieth of the time at most"


def test_what_the_end_needs_is_kept_back(monkeypatch):
    now = [0.0]
    monkeypatch.setattr("spume.run.wall.monotonic", lambda: now[0])
    limit = _Limit(1000.0)
    now[0] = 100.0
    assert not limit.near(10.0)
    now[0] = 110.0
    limit.step()  # of 10 s; needed: 2 (10 + 10) + 50 = 90 s
    now[0] = 909.0
    assert not limit.near(10.0)
    now[0] = 910.0
    assert limit.near(10.0)
    assert not _Limit(None).near(1e9)


@pytest.mark.parametrize(
    ("text", "seconds"),
    [("01:30:00", 5400), ("90:00", 5400), ("2-12:00:00", 216000), ("5400s", 5400), ("90min", 5400), ("1.5h", 5400)],
)
def test_wall_times(text, seconds):
    assert seconds_of(text) == seconds


@pytest.mark.parametrize("text", ["", "90", "1:2", "1-30:00", "0s", "-5min", "1:00:00h", "soon"])
def test_wall_times_that_are_none(text):
    with pytest.raises(ValueError, match="must be a time as 01:30:00, 90min"):
        seconds_of(text)
