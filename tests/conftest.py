"""Device, threads and precision of the tests.

Choosing another runtime loses all arrays and compiled kernels, so tests share one wherever they can:
``runtime`` is a single thread in double precision; tests that ask for ``every_runtime`` are run once
for each combination, grouped so that the combination changes as seldom as possible.
"""

import pytest

from spume import kernels

RUNTIMES = {
    "serial-double": (1, "double"),
    "threads-double": (2, "double"),
    "serial-single": (1, "single"),
}


def pytest_addoption(parser):
    parser.addoption("--device", default="cpu", choices=kernels.DEVICES, help="device that the tests compute on")


@pytest.fixture(scope="session")
def device(request):
    """Name of the device that tests compute on."""
    return request.config.getoption("--device")


@pytest.fixture
def runtime(device):
    """One thread, double precision."""
    return initialized(device, 1, "double")


@pytest.fixture(scope="session", params=list(RUNTIMES))
def _combination(request):
    return RUNTIMES[request.param]


@pytest.fixture
def every_runtime(device, _combination):
    """Each combination of threads and precision in turn."""
    return initialized(device, *_combination)


def initialized(device, threads, precision):
    """Return the runtime of that name, or skip the test where this machine lacks it."""
    try:
        return kernels.initialize(device, threads, precision)
    except kernels.DeviceError as error:
        pytest.skip(str(error))
