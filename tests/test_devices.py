"""The same case on other devices and in single precision."""

import numpy as np
import pytest

from spume import kernels
from spume.particles import ANY
from spume.pressure.conjugate_gradient import ConjugateGradient
from spume.steps.project_in_place import ProjectInPlace
from tanks import advanced, by_id, dam_break

STEPS = 5
FIELDS = ("position", "velocity", "pressure")


def state(device, precision="double"):
    case = dam_break(step=ProjectInPlace(solver=ConjugateGradient(tolerance=1e-6)))
    try:
        kernels.initialize(device, 1, precision)
    except kernels.DeviceError as error:
        pytest.skip(str(error))
    simulation = advanced(case.build(device=device, threads=1, precision=precision), STEPS)
    return simulation.dt, by_id(simulation, *FIELDS, kinds=ANY)


@pytest.fixture(scope="module")
def reference():
    return state("cpu")


def assert_near(found, reference, tolerance):
    assert found[0] == pytest.approx(reference[0], rel=tolerance)
    for name, one, other in zip(FIELDS, found[1], reference[1], strict=True):
        assert np.abs(one - other).max() < tolerance * np.abs(other).max(), name


def test_single_precision(reference):
    found = state("cpu", "single")
    assert found[1][0].dtype == np.float32
    assert_near(found, reference, 2e-3)


@pytest.mark.vulkan
def test_vulkan(reference):
    assert_near(state("vulkan"), reference, 1e-4)


@pytest.mark.gpu
@pytest.mark.parametrize("device", ["cuda", "metal", "amdgpu"])
def test_graphics_cards(reference, device):
    precision = "single" if device == "metal" else "double"
    assert_near(state(device, precision), reference, 1e-4 if precision == "double" else 2e-3)


def test_unknown_devices_are_named():
    with pytest.raises(kernels.DeviceError, match="one of cpu, cuda"):
        kernels.initialize("abacus")
    with pytest.raises(kernels.DeviceError, match="one of double, single"):
        kernels.initialize("cpu", 1, "quadruple")
    with pytest.raises(kernels.DeviceError, match="at least 1"):
        kernels.initialize("cpu", 0)
