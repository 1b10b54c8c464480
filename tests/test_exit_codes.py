"""How the program ends, seen from outside: the exit code, what it says, and what it leaves in the run folder."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

CASE = """\
spacing = 0.025

[time]
end = 0.01

[domain]
gravity = [0.0, -9.81]

[[fluid]]
name = "water"
shape = { kind = "box", lower = [0.0, 0.0], upper = [0.1, 0.1] }
initial = { kind = "uniform", value = [0.0, 0.0] }

[[body]]
name = "tank"
kind = "wall"
shape = { kind = "tank", lower = [0.0, 0.0], upper = [0.1, 0.2], open = ["top"] }

[output]
pictures = false
"""
"""16 particles; all tests run this one, so that its kernels are compiled once."""

SECONDS = 300  # in which a run must have come where it is waited for, compilation included


@pytest.fixture
def start(tmp_path):
    """Start ``spume run`` with keys replaced; what still runs after the test is killed."""
    (tmp_path / "tiny.toml").write_text(CASE, encoding="utf-8")
    started = []

    def start(*settings, device="cpu"):
        words = [part for setting in settings for part in ("--set", setting)]
        command = [sys.executable, "-m", "spume", "run", "tiny.toml", "--out", "out", "--threads", "1", *words]
        command += ["--device", device]
        process = subprocess.Popen(
            command, cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            env=os.environ | {"COLUMNS": "200"},
        )  # fmt: skip
        started.append(process)
        return process

    yield start
    for process in started:
        process.kill()
        process.communicate()


@pytest.fixture
def ended(start):
    """Run to the end; return exit code, standard output and standard error."""

    def ended(*settings, **more):
        process = start(*settings, **more)
        out, err = process.communicate(timeout=SECONDS)
        return process.returncode, out, err

    return ended


def summary(tmp_path):
    return json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))


def test_0_done(ended, tmp_path):
    code, out, err = ended()
    assert (code, "Done: " in out) == (0, True), err
    assert summary(tmp_path)["status"] == "finished"


def test_0_done_by_fluid_that_fell_out(ended, tmp_path):
    """It is warned of when the run begins, and counted at its end."""
    code, out, err = ended(
        "fluid.water.shape.lower=[1.0, 0.0]", "fluid.water.shape.upper=[1.1, 0.1]", "time.end=0.2",
        "domain.lower=[-1.0, -0.1]", "domain.upper=[2.0, 1.0]",
    )  # fmt: skip
    assert code == 0, err
    assert "fluid.water.shape: no body lies below fluid 'water' along gravity: it will fall" in " ".join(err.split())
    assert f"; {summary(tmp_path)['counts']['removed']} particles left the region and were removed" in out


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("spacing=-1", "--set spacing=-1: spacing = -1: must be greater than 0"),
        ("fluid.water.initial.value=[0.0, 1e17]", "tiny.toml:12: fluid.water.initial: gives a velocity of 1e+17 m/s; "),
    ],
)
def test_2_input_to_correct(ended, tmp_path, setting, message):
    code, _, err = ended(setting)
    assert (code, "Traceback" in err) == (2, False)
    assert err.startswith(f"error: {message}")
    assert not (tmp_path / "out").exists()  # scripts ask by it whether there is something to continue


def test_2_a_device_that_this_machine_lacks(ended, tmp_path):
    lacking = "cuda" if sys.platform == "darwin" else "metal"
    code, _, err = ended(device=lacking)
    assert (code, "Traceback" in err) == (2, False)
    assert err.startswith(f"error: device = '{lacking}': not available on this machine")
    assert not (tmp_path / "out").exists()


def test_2_cuda_without_a_card(ended):
    """Where there is one, the same command computes."""
    code, out, err = ended(device="cuda")
    if code == 2:
        assert err.startswith("error: device = 'cuda': not available on this machine: it needs an NVIDIA card and its ")
        assert "nvidia-smi must list it" in err
        assert "Arch" not in err
    else:
        assert (code, "Done: " in out) == (0, True), err


def test_3_diverged_where_a_step_cannot_be_solved(ended, tmp_path):
    code, _, err = ended("step.solver=cg", "step.solver.tolerance=1e-14", "step.solver.largest_iterations=1")
    assert (code, "Traceback" in err) == (3, False)
    assert "the pressure solver failed" in " ".join(err.split())
    assert summary(tmp_path)["status"] == "failed"


@pytest.mark.parametrize(
    ("settings", "limiter"),
    [
        (("fluid.water.initial.value=[0.0, 9.0e3]", "time.end=1e5"), "courant"),
        (("fluid.water.viscosity=1e9", "time.end=1.0"), "viscosity"),
    ],
)
def test_3_diverged_at_the_first_step_where_steps_are_too_short_to_reach_the_end(ended, tmp_path, settings, limiter):
    code, _, err = ended(*settings)
    assert (code, "Traceback" in err) == (3, False)
    assert f"limited by {limiter}" in " ".join(err.split())
    said = summary(tmp_path)
    assert (said["status"], said["failure"]["step"]) == ("failed", 1)
    assert said["failure"]["reason"].startswith("the time step collapsed to ")


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no SIGTERM that a program can answer")
def test_4_interrupted_and_continued(start, tmp_path):
    process = start("time.end=1e4")
    log, begin = tmp_path / "out" / "log.csv", time.monotonic()
    while not (log.exists() and log.read_text().count("\n") > 1):
        assert process.poll() is None, process.communicate()
        assert time.monotonic() - begin < SECONDS
        time.sleep(0.05)
    process.send_signal(signal.SIGTERM)
    out, err = process.communicate(timeout=SECONDS)
    assert (process.returncode, "Traceback" in err) == (4, False)
    assert "spume run --resume out" in " ".join(out.split())
    said = summary(tmp_path)
    assert (said["status"], said["reason"]) == ("interrupted", "stopped by SIGTERM")
    assert said["steps"] > 0
    assert (tmp_path / "out" / "checkpoint.h5").exists()
