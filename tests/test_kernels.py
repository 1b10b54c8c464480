"""Threads from the surroundings, the folder of compiled kernels."""

import os
import subprocess
import sys
import tracemalloc

import pytest

from spume import kernels


@pytest.fixture
def machine(monkeypatch):
    """Eight processors, no quota, nothing asked for."""
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(8)), raising=False)
    monkeypatch.setattr(kernels, "quota", lambda _: 0)
    for name in ("SLURM_CPUS_PER_TASK", "OMP_NUM_THREADS"):
        monkeypatch.delenv(name, raising=False)
    return monkeypatch


@pytest.mark.parametrize(
    ("slurm", "openmp", "quota", "threads"),
    [
        (None, None, 0, 8),
        ("4", None, 0, 4),
        (None, "3", 0, 3),
        ("4", "3", 0, 4),  # the scheduler's word goes before OpenMP's
        ("16", None, 0, 8),  # never more than affinity allows
        (None, None, 2, 2),
        ("4", None, 2, 2),
        (None, "5,2", 0, 5),
        ("", "0", 0, 8),
        ("x", None, 0, 8),
    ],
)
def test_threads_from_the_surroundings(machine, slurm, openmp, quota, threads):
    for name, value in (("SLURM_CPUS_PER_TASK", slurm), ("OMP_NUM_THREADS", openmp)):
        if value is not None:
            machine.setenv(name, value)
    machine.setattr(kernels, "quota", lambda _: quota)
    assert kernels.available_threads() == threads


def test_no_more_threads_than_processors(machine, caplog):
    machine.setattr(kernels.log, "propagate", True)
    machine.setenv("OMP_NUM_THREADS", "2")  # a wish, which an explicit number goes before
    machine.setattr(kernels, "quota", lambda _: 4)
    assert [kernels.possible_threads(n) for n in (1, 2, 4)] == [1, 2, 4]
    assert caplog.messages == []
    assert kernels.possible_threads(100_000) == 4
    # Once or twice: an earlier run may have left another handler of the same log.
    assert set(caplog.messages) == {"threads = 100000: this process may use 4 processors; 4 threads compute"}


@pytest.mark.parametrize(
    ("files", "processors"),
    [
        ({"cpu.max": "150000 100000\n"}, 2),
        ({"cpu.max": "max 100000\n"}, 0),
        ({"cpu/cpu.cfs_quota_us": "400000\n", "cpu/cpu.cfs_period_us": "100000\n"}, 4),
        ({"cpu/cpu.cfs_quota_us": "-1\n", "cpu/cpu.cfs_period_us": "100000\n"}, 0),
        ({"cpu.max": "nonsense"}, 0),
        ({}, 0),
    ],
)
def test_quota_of_a_control_group(tmp_path, files, processors):
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    assert kernels.quota(tmp_path) == processors


def test_cache_folder(tmp_path, monkeypatch):
    monkeypatch.setenv("SPUME_CACHE", str(tmp_path / "here"))
    assert kernels.cache_folder() == tmp_path / "here"
    monkeypatch.delenv("SPUME_CACHE")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert kernels.cache_folder() == tmp_path / "xdg" / "spume"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert kernels.cache_folder() == tmp_path / "home" / ".cache" / "spume"


def test_a_cache_folder_that_cannot_be_written_is_replaced(tmp_path, monkeypatch, caplog):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("SPUME_CACHE", str(tmp_path / "file" / "cache"))  # below a file: not even for the superuser
    with caplog.at_level("WARNING", logger="spume"):
        folder = kernels.cache_folder()
    assert folder.is_dir()
    assert "cannot hold compiled kernels" in caplog.text


def test_a_home_that_cannot_be_written_is_no_obstacle(tmp_path):
    (tmp_path / "file").write_text("")
    environment = {k: v for k, v in os.environ.items() if k not in ("SPUME_CACHE", "XDG_CACHE_HOME")}
    environment["HOME"] = str(tmp_path / "file" / "home")
    code = "from spume import kernels; print(kernels.initialize('cpu', 1).threads); kernels.array(kernels.i32, 3)"
    answer = subprocess.run(
        [sys.executable, "-c", code], env=environment, cwd=tmp_path, capture_output=True, text=True, check=True
    )
    assert answer.stdout.split()[-1] == "1"
    assert "cannot hold compiled kernels" in answer.stderr


def test_the_library_installs_no_log_handlers():
    code = "import logging, spume.run; print(logging.getLogger('spume').handlers, logging.getLogger().handlers)"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout.strip() == "[] []"


def test_calls_with_new_numbers_leave_nothing_behind(runtime):
    """A run calls its kernels with new times and steps for ever."""
    source = "def scaled(values: Reals, factor: real):\n    for i in range(4):\n        values[i] *= factor\n"
    made = kernels.compiled("scaled", source, Reals=kernels.array_type(runtime.real), real=runtime.real)
    values = kernels.array(runtime.real, 4)
    numbers = [1.0 + 1e-3 * k for k in range(1200)]
    for number in numbers[:20]:
        made(values, number)
    tracemalloc.start()
    for number in numbers:
        made(values, number)
    left, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert left < 200_000


@pytest.mark.parametrize(("shape", "integer"), [((), True), ((), False), ((3,), False), ((3, 3), False)])
def test_arrays_are_of_zeros_where_others_were(runtime, shape, integer):
    value = kernels.value_type(shape, integer)
    for _ in range(20):
        data = kernels.array(value, 10_000)
        found = kernels.host(data)
        assert not found.any()
        found[:] = 7
        kernels.publish(data, found)
        del data, found
