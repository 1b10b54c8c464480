"""The same case on other devices and in single precision."""

import numpy as np
import pytest

from spume import kernels
from spume.particles import ANY
from spume.pressure.conjugate_gradient import ConjugateGradient
from spume.pressure.multigrid import Multigrid, coarse_levels
from spume.steps.project_in_place import ProjectInPlace
from tanks import advanced, by_id, dam_break

STEPS = 5
FIELDS = ("position", "velocity", "pressure")


def state(device, precision="double", solver=ConjugateGradient):
    case = dam_break(step=ProjectInPlace(solver=solver(tolerance=1e-6)))
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


def test_a_thread_for_each_row(reference, monkeypatch):
    """As graphics cards work, on the processor."""
    monkeypatch.setenv("SPUME_WIDE", "1")
    assert_near(state("cpu"), reference, 1e-4)


@pytest.mark.vulkan
def test_vulkan(reference):
    found = state("vulkan", solver=Multigrid)
    assert_near(found, reference, 1e-4)
    rows, entries = coarse_levels(2)[0]
    assert entries > 3 * rows, "coarse levels that are not built right make it slow, not wrong"


@pytest.mark.gpu
@pytest.mark.parametrize("device", ["cuda", "metal", "amdgpu"])
def test_graphics_cards(reference, device):
    precision = "single" if device == "metal" else "double"
    found = state(device, precision, Multigrid)
    assert_near(found, reference, 1e-4 if precision == "double" else 2e-3)
    rows, entries = coarse_levels(2)[0]
    assert entries > 3 * rows


def test_unknown_devices_are_named():
    with pytest.raises(kernels.DeviceError, match="one of cpu, cuda"):
        kernels.initialize("abacus")
    with pytest.raises(kernels.DeviceError, match="one of double, single"):
        kernels.initialize("cpu", 1, "quadruple")
    with pytest.raises(kernels.DeviceError, match="at least 1"):
        kernels.initialize("cpu", 0)
