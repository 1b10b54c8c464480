"""Whoever ends `spume validate` ends its runs, each with a checkpoint."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from spume.outputs import summary

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are looked up in /proc")


def children(pid: int) -> set[int]:
    """Return the processes that a process has started."""
    found = set()
    for folder in Path("/proc").iterdir():
        try:
            if folder.name.isdigit() and int((folder / "stat").read_text().rpartition(")")[2].split()[1]) == pid:
                found.add(int(folder.name))
        except OSError:  # gone meanwhile
            continue
    return found


def running(pid: int) -> bool:
    """Return whether a process exists and is no zombie that nobody has asked for."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def started(tmp_path):
    """Start a validation; return it, the folder of its first run and the processes that it started."""
    command = [sys.executable, "-m", "spume", "validate", "hydrostatic", "--out", str(tmp_path), "--jobs", "1"]
    parent = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    folder = tmp_path / "hydrostatic" / "runs" / "10"
    log = folder / "log.csv"
    until(lambda: log.exists() and log.read_text().count("\n") > 2)
    return parent, folder, children(parent.pid)


def until(condition, seconds=120.0):
    """Wait until a condition holds."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.1)


@pytest.mark.parametrize("number", ["SIGTERM", "SIGKILL"])
def test_no_run_outlives_the_command(number, tmp_path):
    parent, folder, processes = started(tmp_path)
    assert processes
    os.kill(parent.pid, getattr(signal, number))
    parent.communicate(timeout=60)
    # A batch system ends what is left when the command is gone: it has to wait for the checkpoints.
    assert (parent.returncode < 0) == (number == "SIGKILL")
    until(lambda: not any(running(pid) for pid in processes), 60.0)
    assert summary.read(folder)["status"] == "interrupted"
    assert (folder / "checkpoint.h5").exists()
    assert not (folder.parent / "20").exists()


def test_a_worker_that_is_killed_ends_the_command_with_words(tmp_path):
    parent, _, processes = started(tmp_path)
    worker = next(pid for pid in processes if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes())
    os.kill(worker, signal.SIGKILL)
    said = parent.communicate(timeout=60)[0]
    assert "the same command goes on" in " ".join(said.split())
    assert "Traceback" not in said
