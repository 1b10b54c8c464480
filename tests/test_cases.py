"""Every built-in case runs its first steps."""

import numpy as np
import pytest

from spume.case import built_in_cases, load
from tanks import advanced

COARSER = {
    "cavity": 0.1,
    "dam-break": 0.03,
    "dam-break-3d": 0.03,
    "dam-break-martin-moyce": 0.005715,
    "dam-break-stl": 0.04,
    "elliptical-drop": 0.1,
    "faraday": 0.05,
    "hydrostatic": 0.05,
    "hydrostatic-3d": 0.05,
    "linear-sway": 0.05,
    "oscillating-drop": 0.1,
    "rolling-tank": 0.02,
    "rotating-square": 0.1,
    "sloshing": 0.0186,
    "sloshing-3d": 0.0124,
    "standing-wave": 0.1,
    "sway-sloshing": 0.05,
    "taylor-green": 0.05,
}
"""Spacings [m] that make the cases small; those that are small already are run as they are."""


@pytest.mark.parametrize("name", built_in_cases())
def test_first_steps(device, name):
    overrides = [f"spacing={COARSER[name]}"] if name in COARSER else []
    simulation = load(name, overrides).build(device=device, threads=1)
    rows = len(simulation.fetch("id"))
    advanced(simulation, steps=3)
    assert simulation.step_index == 3
    assert simulation.time > 0
    assert len(simulation.fetch("id")) == rows, "no row is lost"
    for field in ("position", "velocity", "pressure"):
        assert np.isfinite(simulation.fetch(field)).all()
    assert simulation.statistics["iterations"] > 0
    assert simulation.statistics["removed"] == 0
