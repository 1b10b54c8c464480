"""The README's examples run as they stand."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

import spume

README = Path(__file__).parents[1] / "README.md"
MAIN_JOB = "python3 -m venv .venv && . .venv/bin/activate && pip install . && spume run dam-break"
TESTS = 'python3 -m venv .venv && . .venv/bin/activate && pip install ".[test]" && pytest'


@pytest.fixture(scope="module")
def readme() -> str:
    if not README.exists():
        pytest.skip("no README beside the tests")
    return README.read_text(encoding="utf-8")


def block(readme: str, language: str) -> str:
    """Return the one code block in a language."""
    (text,) = re.findall(rf"^```{language}\n(.*?)^```", readme, re.MULTILINE | re.DOTALL)
    return text


def test_the_two_commands(readme):
    commands = re.findall(r"^```sh\n(.*?)^```", readme, re.MULTILINE | re.DOTALL)
    assert MAIN_JOB + "\n" in commands
    assert TESTS + "\n" in commands


def test_links_lead_somewhere(readme):
    targets = [t for t in re.findall(r"\]\(([^)\s]+)\)", readme) if "://" not in t]
    assert targets
    assert [t for t in targets if not (README.parent / t.split("#")[0]).exists()] == []


@pytest.mark.slow
def test_python_example(readme, tmp_path):
    code = block(readme, "python")
    assert len([line for line in code.splitlines() if line.strip()]) <= 12
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True, timeout=300)
    assert list(tmp_path.rglob("run.vtkhdf"))
    # It is the case of the case file, as the README says.
    (tmp_path / "column.toml").write_text(block(readme, "toml"), encoding="utf-8")
    (saved,) = tmp_path.rglob("case.toml")
    tables = [spume.load(file).table() for file in (tmp_path / "column.toml", saved)]
    for table in tables:
        table.pop("gauge", None)
    assert tables[0] == tables[1]


def test_case_file_example(readme, tmp_path):
    (tmp_path / "column.toml").write_text(block(readme, "toml"), encoding="utf-8")
    command = [
        sys.executable,
        "-m",
        "spume.cli",
        "run",
        "column.toml",
        "--set",
        "time.end=0.02",
        "--out",
        "out",
    ]
    subprocess.run(command, cwd=tmp_path, check=True, timeout=300)
    assert (tmp_path / "out" / "run.vtkhdf").exists()
