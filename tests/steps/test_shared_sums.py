"""Sums that two models of a step want in one field."""

import numpy as np
import pytest

from spume.schemes.laplacian.distance import Distance
from spume.schemes.turbulence.smagorinsky import Smagorinsky
from spume.schemes.viscosity.explicit import Explicit
from spume.schemes.weight.quadratic import Quadratic
from spume.steps.project_in_place import ProjectInPlace
from tanks import advanced, by_id, dam_break


@pytest.mark.parametrize("parameters", [{"re": 1.6}, {"weight": Quadratic()}], ids=["re", "weight"])
def test_models_may_differ_in_radius_and_weight(device, parameters):
    """The second moment of the divergence and that of the turbulence, whose eddies do next to nothing here."""
    found = []
    for turbulence in (Smagorinsky(constant=1e-6), Smagorinsky(constant=1e-6, **parameters)):
        step = ProjectInPlace(viscosity=Explicit(laplacian=Distance(), turbulence=turbulence))
        simulation = dam_break(step=step).build(device=device, threads=1)
        advanced(simulation, steps=10)
        found.append(by_id(simulation, "position"))
    assert np.all(np.isfinite(found[1]))
    assert found[1] == pytest.approx(found[0], abs=1e-8)
