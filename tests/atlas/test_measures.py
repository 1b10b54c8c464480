"""The atlas: what it calls noise and disorder, which combinations it has."""

import numpy as np
import pytest

from spume.atlas.combinations import combinations
from spume.atlas.measures import disorder, spatial_noise, temporal_noise
from spume.atlas.problems import PROBLEMS
from spume.atlas.report import by_place, figure
from spume.case import built_in_cases, load


def lattice(n=20, l0=0.1):
    return l0 * np.stack(np.meshgrid(np.arange(n), np.arange(n)), -1).reshape(-1, 2).astype(float)


def test_a_linear_pressure_has_no_noise_in_space():
    x = lattice() + np.random.default_rng(0).uniform(-0.01, 0.01, (400, 2))
    assert spatial_noise(x, 3.0 + 20.0 * x[:, 0] - 7.0 * x[:, 1], 0.1) == pytest.approx(0.0, abs=1e-9)


def test_white_noise_is_measured():
    rng = np.random.default_rng(1)
    assert 0.95 < spatial_noise(lattice(40), rng.normal(size=1600), 0.1) < 1.35
    assert temporal_noise(rng.normal(size=20000)) == pytest.approx(1.0, rel=0.03)
    assert temporal_noise(np.linspace(0.0, 5.0, 100)) == pytest.approx(0.0, abs=1e-9)


def test_disorder_is_that_of_the_nearest_neighbour():
    x = lattice()
    assert disorder(x, 0.1) == pytest.approx(0.0, abs=1e-9)
    x[::2, 0] += 0.03
    assert 0.2 < disorder(x, 0.1) < 0.31


def test_every_combination_is_a_case_of_every_problem():
    found = combinations()
    assert found[0].name == "default"
    assert len({c.name for c in found}) == len(found)
    assert {"published", "gradient", "shifting", "free_surface"} <= {c.slot for c in found}
    assert {p.case for p in PROBLEMS} <= set(built_in_cases())
    for problem in PROBLEMS:
        load(problem.case, list(problem.settings))
    for combination in found:
        load("taylor-green", list(combination.settings))


def test_the_figure_shows_failures(tmp_path):
    runs = [
        {"combination": "default", "problem": "p", "status": "finished", "error": 0.1},
        {"combination": "other", "problem": "p", "status": "failed", "reason": "exploded"},
    ]
    results = {"combinations": [{"name": "default"}, {"name": "other"}], "problems": [{"name": "p"}], "runs": runs}
    assert by_place(results)["other", "p"]["status"] == "failed"
    figure(results, tmp_path / "f.png")
    assert (tmp_path / "f.png").stat().st_size > 0
