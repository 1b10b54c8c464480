"""The scripts in benchmarks/ fit the package: what they make themselves is made."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

FILE = Path(__file__).parents[1] / "benchmarks" / "pressure_systems.py"

pytestmark = pytest.mark.skipif(not FILE.exists(), reason="no benchmarks beside the tests")


def test_systems_are_those_of_the_solver(runtime):
    spec = importlib.util.spec_from_file_location(FILE.stem, FILE)
    systems = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(systems)
    particles, system = systems.assembled("column", 150, 2)
    matrix, right = systems.sparse(particles, system)
    assert matrix.shape == (len(right), len(right))
    assert abs(matrix - matrix.T).max() < 1e-6 * abs(matrix).max()
    assert np.all(matrix.diagonal() > 0)
