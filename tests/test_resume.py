"""Runs that are interrupted, killed or starved of disk, and continued: the same bits as without."""

import os
import shutil
import signal
import subprocess
import sys

import numpy as np
import pytest

import spume
from spume import kernels
from spume.outputs import OutputSettings, checkpoint, summary, vtkhdf
from spume.outputs.gauges import Elevation, Volume
from spume.progress import Progress
from spume.run import run
from spume.steps.predict_move_project import PredictMoveProject
from tanks import column, dam_break

END = 0.12


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
        (column(disturbance=0.1), 12),  # nearly at rest: lists serve many steps
    ],
    ids=["project-in-place", "predict-move-project", "at-rest"],
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
            found.append(kernels.host(pairs.neighbour)[start : start + length].tolist())
        assert found[0] == found[1]


def test_writing_changes_nothing_in_the_trajectory(whole, tmp_path):
    """A run with frames, gauges and a checkpoint at every step against one that only advances."""
    simulation = case_of().build(threads=1)
    simulation.run()
    run(case_of(interval=1e-4), tmp_path / "busy")
    a, b, c = simulation.state()[0], checkpoint.read(tmp_path / "busy").arrays, checkpoint.read(whole).arrays
    assert all(a[name].tobytes() == b[name].tobytes() == c[name].tobytes() for name in a)


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="no SIGKILL")
def test_a_run_that_is_killed_goes_on(whole, tmp_path):
    """Killed at two instants, the second in the run that continues the first; 20 random ones are in validation/."""
    folder = tmp_path / "run"
    code = (
        "import os, signal, sys\n"
        "sys.path.insert(0, {tests!r})\n"
        "from test_resume import case_of\n"
        "import spume\n"
        "from spume.progress import Progress\n"
        "from spume.run import run\n"
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
