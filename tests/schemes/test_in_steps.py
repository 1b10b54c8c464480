"""Every gradient and every source in every step that takes it, with the walls of that step: water at rest is held."""

import numpy as np
import pytest

from spume import named
from spume.build import build
from spume.schemes import discover
from tanks import STEPS, advanced, column

discover()
CHOICES = [
    (name, family, scheme.key)
    for name, step in STEPS.items()
    for family in ("gradient", "source")
    for scheme in named.schemes(family)
    if family == "gradient" or scheme.instant in step.instants
]

pytestmark = pytest.mark.usefixtures("runtime")


@pytest.mark.parametrize(("name", "family", "key"), CHOICES)
def test_water_at_rest_is_held(name, family, key):
    """A gradient or source that did nothing would let it fall at g t."""
    case = column(cells=(6, 8), disturbance=0.05, step=STEPS[name](**{family: named.find(family, key)()}))
    simulation = advanced(build(case, threads=1), steps=12)
    u = simulation.fetch("velocity")[simulation.snapshot().fluid]
    assert np.isfinite(u).all()
    assert np.abs(u.mean(axis=0)[1]) < 0.2 * 9.81 * simulation.time
    assert simulation.statistics["removed"] == 0
