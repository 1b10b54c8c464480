"""One thread and two: the same pressure to the tolerance, the same motion, and the same bits when run again."""

import numpy as np
import pytest

import spume
from conftest import initialized
from spume import chunks, kernels
from spume.pressure import aggregation, multigrid


@pytest.fixture
def everything_in_threads(monkeypatch):
    """Let few rows be worked on by as many threads as there are, which else only pays for many."""
    monkeypatch.setattr(aggregation, "alone", lambda rows: kernels.runtime().serial)
    monkeypatch.setattr(kernels, "light", lambda rows: kernels.runtime().serial)
    multigrid._workspace.cache_clear()
    yield
    multigrid._workspace.cache_clear()


@pytest.mark.slow
def test_one_thread_and_two_agree(device, everything_in_threads, monkeypatch):
    spacing = 0.02
    case = spume.load("dam-break", [f"spacing={spacing}", "step.solver.tolerance=1e-9"])
    first, last, iterations = [], [], []
    for threads, most in ((1, chunks.MOST_ENTRIES), (2, chunks.MOST_ENTRIES), (2, chunks.MOST_ENTRIES), (2, 4000)):
        monkeypatch.setattr(chunks, "MOST_ENTRIES", most)
        initialized(device, threads, "double")
        simulation = case.build(device=device, threads=threads)
        for _ in range(5):
            simulation.advance()
            iterations.append(simulation.statistics["iterations"])
            if simulation.step_index in (1, 5):
                state = simulation.snapshot()
                order = np.argsort(state["id"])
                found = {n: state[n][order] for n in ("position", "pressure", "velocity")}
                (first if simulation.step_index == 1 else last).append(found)
    assert min(iterations) > 0
    assert len(simulation.domain.system.columns) >= 3
    one, two, *_ = first
    assert one["pressure"].max() > 1000.0
    # A residual of 1e-9 is an error of the pressure of at most that times the condition, about 1e3 here.
    assert two["pressure"] == pytest.approx(one["pressure"], abs=1e-7 * one["pressure"].max())
    one, two, again, in_chunks = last
    assert two["position"] == pytest.approx(one["position"], abs=1e-6 * spacing)
    assert np.abs(one["velocity"]).max() > 0.01
    for name in one:
        assert np.array_equal(two[name], again[name]), name
        assert np.array_equal(two[name], in_chunks[name]), name
