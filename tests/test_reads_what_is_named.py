"""Case files execute nothing, and nothing is opened but the case file and the files that it names.

The interpreter's own audit events tell. A second process loads each case twice: the first time for the program's own
modules, the second time, from a copy, under watch.
"""

import json
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from spume.named import CASES

WATCHER = """\
import json, os, sys
from spume.build import check_gauges, initial_rows
from spume.case import load
from spume.problems import CaseError

def everything(file, rows):
    try:
        case = load(file)
        for reference in case.reference:
            reference.load()
        if rows:
            check_gauges(case, initial_rows(case))
    except CaseError as error:
        return str(error)
    return ""

seen = []
watching = False
FOREIGN = ("subprocess", "os.", "pty", "socket", "urllib", "ctypes", "exec", "compile", "import", "code", "pickle")
HARMLESS = ("os.listdir", "os.scandir")

def watch(event, given):
    if not watching:
        return
    if event == "open":
        path, mode, flags = given
        writes = flags & (os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC)
        seen.append(["write" if writes else "open", os.path.realpath(path) if isinstance(path, str) else repr(path)])
    elif event.startswith(FOREIGN) and event not in HARMLESS:
        seen.append([event, repr(given)[:200]])

sys.addaudithook(watch)
for first, second, rows in json.loads(sys.argv[1]):
    everything(first, rows)
    seen.clear()
    watching = True
    error = everything(second, rows)
    watching = False
    print(json.dumps({"file": second, "seen": seen, "error": error}))
"""

NAMED = """\
title = "__import__('os').system('touch executed')"
spacing = 0.05

[time]
end = 0.1

[[fluid]]
name = "water"
shape = { kind = "box", lower = [0.0, 0.0], upper = [0.4, 0.4] }
initial = { kind = "table", file = "data/flow.csv" }

[[body]]
name = "$(touch${IFS}executed)"
kind = "wall"
shape = { kind = "tank", lower = [0.0, 0.0], upper = [0.4, 0.6], open = ["top"] }
motion = { kind = "series", file = "../beside/motion.csv" }

[[gauge]]
name = "`touch_executed`"
kind = "elevation"
at = [0.2]

[[reference]]
gauge = "`touch_executed`"
file = "data/level.csv"
"""
"""A case that names three files, and whose texts are programs in the languages that might be asked to run them."""

FILES = {
    "case/data/flow.csv": "x,y,u,v\n0,0,0,0\n1,0,0,0\n0,1,0,0\n1,1,0,0\n",
    "beside/motion.csv": "time,x\n0,0\n0.05,0\n0.1,0\n0.2,0\n",
    "case/data/level.csv": "time [s],eta [m]\n0,0.4\n1,0.4\n",
    "case/data/unnamed.csv": "time,x\n0,0\n1,0\n",
}


@pytest.fixture(scope="module")
def watched():
    """Return what was seen while case files were loaded, by file."""

    def watched(files):
        answer = subprocess.run(
            [sys.executable, "-B", "-c", WATCHER, json.dumps(files)], capture_output=True, text=True, check=True
        )
        found = [json.loads(line) for line in answer.stdout.splitlines()]
        for one in found:
            one["seen"] = [[event, what] for event, what in one["seen"] if (event, described(what)) != ("open", True)]
        return {one["file"]: one for one in found}

    return watched


def described(what):
    """Return whether a file describes installed packages, among which models of others are looked for."""
    return Path(what).parent.suffix in (".dist-info", ".egg-info") or Path(what).suffix == ".zip"


def files_of(document, folder):
    """Return the files that a case's text names, wherever they are."""

    def values(value):
        if isinstance(value, dict):
            for key, item in value.items():
                if key == "file":
                    yield item
                else:
                    yield from values(item)
        elif isinstance(value, list):
            for item in value:
                yield from values(item)

    found = {next(p for p in (folder / name, CASES / name) if p.is_file()) for name in values(tomllib.loads(document))}
    return {str(path.resolve()) for path in found}


def test_built_in_cases_open_what_they_name(watched, tmp_path):
    shutil.copytree(CASES, tmp_path / "cases")
    originals = sorted(CASES.glob("*/case.toml"))
    copies = [tmp_path / "cases" / original.parent.name / "case.toml" for original in originals]
    found = watched([[str(a), str(b), False] for a, b in zip(originals, copies, strict=True)])
    assert len(found) == len(copies) > 10
    for copy in copies:
        itself = {str(copy.resolve())}
        named = files_of(copy.read_text(encoding="utf-8"), copy.parent)
        assert found[str(copy)]["error"] == ""
        assert {event for event, _ in found[str(copy)]["seen"]} == {"open"}
        assert itself <= {what for _, what in found[str(copy)]["seen"]} <= itself | named


def test_a_case_with_its_own_files_opens_them_and_executes_nothing(watched, tmp_path):
    for place in ("first", "second"):
        for name, text in {**FILES, "case/case.toml": NAMED}.items():
            path = tmp_path / place / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")
    first, second = (tmp_path / place / "case" / "case.toml" for place in ("first", "second"))
    found = watched([[str(first), str(second), True]])[str(second)]
    assert found["error"] == ""
    assert {event for event, _ in found["seen"]} == {"open"}
    named = ("case/case.toml", "case/data/flow.csv", "beside/motion.csv", "case/data/level.csv")
    assert {what for _, what in found["seen"]} == {str((tmp_path / "second" / name).resolve()) for name in named}
    assert not list(tmp_path.rglob("*executed*"))
