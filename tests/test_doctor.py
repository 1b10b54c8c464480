"""spume doctor: it finds what is there, names what is not, and its self-test can fail."""

import json
import os
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from spume import doctor
from spume.cli import app
from spume.outputs import film, render


def call(*words):
    result = CliRunner().invoke(app, ["doctor", *words])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return result


def by_name(checks):
    return {check.name: check for check in checks}


def test_this_machine_is_ready(monkeypatch):
    monkeypatch.delenv("SPUME_DEVICE", raising=False)
    monkeypatch.setattr(render, "available", lambda: (True, "OpenGL"))  # tests of rendered pictures show that it works
    result = call("--json")
    answer = json.loads(result.stdout)
    assert (result.exit_code, answer["ok"]) == (0, True)
    checks = {check["name"]: check for check in answer["checks"]}
    assert {"Python", "quadrants", "cpu", "cuda", "threads", "cache of kernels", "ffmpeg", "view"} <= set(checks)
    assert all(checks[name]["state"] == "found" for name in ("Python", "quadrants", "cpu", "pressure at rest"))
    assert "Pa, exact 1962.0 Pa" in checks["pressure at rest"]["value"]
    lacking = [c for c in answer["checks"] if c["state"] == "broken" and not c["remedy"]]
    assert lacking == []


@pytest.mark.parametrize(
    ("pressure", "state"), [(1962.0, "found"), (1925.0, "found"), (1920.0, "broken"), (0.0, "broken")]
)
def test_the_self_test_judges_the_pressure(monkeypatch, pressure, state):
    figures = {"pressure": pressure, "exact": 1962.0, "steps": 60, "seconds": 1.0, "compilation": 1.0}
    monkeypatch.setattr(doctor, "_end", lambda process: (0, json.dumps(figures)))
    monkeypatch.setattr(doctor, "_start", lambda *words: None)
    check = doctor.self_test()
    assert (check.state, check.ok) == (state, state == "found")


def test_a_self_test_that_crashes_or_hangs_is_no_pass(monkeypatch):
    monkeypatch.setattr(doctor, "_start", lambda *words: None)
    monkeypatch.setattr(doctor, "_end", lambda process: (-11, ""))
    assert "crashed (-11)" in doctor.self_test().value
    monkeypatch.setattr(doctor, "_end", lambda process: (None, ""))
    assert "no answer within" in doctor.self_test().value
    assert not doctor.self_test().ok


def test_a_device_that_is_asked_for_and_not_there(monkeypatch):
    lacking = "cuda" if sys.platform == "darwin" else "metal"
    monkeypatch.setattr(doctor, "_start", lambda *words: words[-1])
    monkeypatch.setattr(doctor, "_end", lambda device: (0, "") if device == "cpu" else (7, "not available"))
    monkeypatch.setenv("SPUME_DEVICE", lacking)
    checks = by_name(doctor.devices())
    assert not checks[lacking].ok
    assert "SPUME_DEVICE" in checks[lacking].remedy
    assert checks["cpu"].ok
    assert checks["vulkan"].ok  # not there, not needed
    monkeypatch.setenv("SPUME_DEVICE", "abacus")
    checks = by_name(doctor.devices())
    assert not checks["SPUME_DEVICE"].ok


def test_a_cache_and_a_folder_that_cannot_be_written(monkeypatch, tmp_path):
    file = tmp_path / "file"
    file.write_text("")
    monkeypatch.setenv("SPUME_CACHE", str(file / "cache"))
    checks = by_name(doctor.machine(file / "results"))
    assert (checks["cache of kernels"].state, checks["cache of kernels"].ok) == ("broken", True)
    assert "SPUME_CACHE" in checks["cache of kernels"].remedy
    assert not checks["results"].ok


def test_a_full_disk(monkeypatch, tmp_path):
    monkeypatch.setattr(doctor, "ROOM", 1 << 62)
    assert "make room" in by_name(doctor.machine(tmp_path))["room for results"].remedy


def test_missing_and_broken_libraries(monkeypatch):
    monkeypatch.setattr(doctor, "requirements", lambda: (["numpy", "no-such-library"], {"view": ["no-such-viewer"]}))
    monkeypatch.setitem(sys.modules, "numpy", None)
    checks = by_name(doctor.installation())
    assert (checks["no-such-library"].state, checks["no-such-library"].ok) == ("missing", False)
    assert (checks["numpy"].state, checks["numpy"].ok) == ("broken", False)
    assert checks["view"].ok
    assert 'pip install "spume[view]"' in checks["view"].remedy


def test_the_command_ends_with_2_and_says_what_is_missing(monkeypatch):
    bad = doctor.Check("libraries", "h5py", "missing", "not installed", "pip install h5py", needed=True)
    monkeypatch.setattr(doctor, "examine", lambda quick: iter([bad]))
    result = call()
    assert result.exit_code == 2
    assert "Not ready: libraries: h5py" in result.output
    assert "→ pip install h5py" in result.output


def test_requirements_are_those_of_the_package():
    base, extras = doctor.requirements()
    assert {"quadrants", "numpy", "matplotlib"} <= set(base)
    assert "pyvista" in extras["view"]


def test_pictures_without_pyvista_and_ffmpeg(monkeypatch):
    monkeypatch.setattr(film, "ffmpeg", lambda: None)
    monkeypatch.setattr(doctor, "_version", lambda name: None)
    checks = by_name(doctor.pictures())
    assert all('pip install "spume[view]"' in check.remedy for check in checks.values())
    assert len(checks) == 2


@pytest.mark.parametrize("hidden", ["quadrants", "numpy"])
def test_it_examines_what_is_left_where_a_library_is_missing(hidden, tmp_path):
    """In a process of its own, as the modules that import the library are loaded here."""
    code = (
        f"import sys; sys.modules[{hidden!r}] = None; sys.argv = ['spume', 'doctor', '--quick']\n"
        "from spume.cli import main\n"
        "main()\n"
    )
    environment = {**os.environ, "SPUME_CACHE": str(tmp_path)}
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, env=environment)
    assert (answer.returncode, "Traceback" in answer.stderr) == (2, False), answer.stderr
    said = " ".join(answer.stdout.split())
    assert "Not ready: " in said
    assert f"libraries: {hidden}" in said.partition("Not ready: ")[2]
    assert "mend the libraries first" in said
