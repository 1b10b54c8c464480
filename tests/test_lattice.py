"""Reference sums of the regular arrangement, and weight functions in both languages."""

import itertools
import math

import numpy as np
import pytest

from spume import kernels, named
from spume.lattice import Lattice
from spume.schemes import discover
from spume.schemes.weight.inverse import Inverse

discover()
WEIGHTS = [scheme() for scheme in named.schemes("weight")]

# Written from the literature and not from the code: W at r/re = 0.3 and 0.8.
REFERENCE = {
    "inverse": (1 / 0.3 - 1, 0.25),
    "inverse-square": (1 / 0.09 - 1, 1 / 0.64 - 1),
    "inverse-bounded": (1 / (0.85 * 0.3 + 0.15) - 1, 1 / (0.85 * 0.8 + 0.15) - 1),
    "gaussian": (math.exp(-0.81) - math.exp(-9), math.exp(-5.76) - math.exp(-9)),
    "cubic-spline": (1 - 1.5 * 0.36 + 0.75 * 0.216, 0.25 * 0.4**3),
    "quadratic": (0.49, 0.04),
    "isochoric": (
        0.49 * (1 - 1.6308 + 1.47555 - 0.564759 + 0.0769581),
        0.04 * (1 - 4.3488 + 10.4928 - 10.709504 + 3.8916096),
    ),
    "wendland": (0.7**4 * 2.2, 0.2**4 * 4.2),
}


@pytest.mark.parametrize("weight", [w for w in WEIGHTS if w.key in REFERENCE], ids=lambda w: w.key)
def test_values_of_the_weights(weight):
    re = 0.21
    assert weight.values(np.array([0.3, 0.8]) * re, re) == pytest.approx(REFERENCE[weight.key], rel=1e-12)
    assert weight.values(re * (1 - 1e-9), re) == pytest.approx(0.0, abs=1e-8)
    r = np.linspace(0.05, 0.999, 50) * re
    assert np.all(np.diff(weight.values(r, re)) < 0), "a weight falls with the distance"


@pytest.mark.parametrize("weight", WEIGHTS, ids=lambda w: w.key)
def test_slopes_of_the_weights(weight):
    re, h = 0.7, 1e-6
    r = re * np.array([0.2, 0.45, 0.55, 0.8, 0.95])
    by_difference = (weight.values(r + h, re) - weight.values(r - h, re)) / (2 * h)
    assert type(weight).slope(r, re) == pytest.approx(by_difference, rel=1e-7)
    assert weight.values(7 * r, 7 * re) == pytest.approx(weight.values(r, re), rel=1e-9), "scale-free"


def _sum_at(points, weight, re=2.1):
    r = np.linalg.norm(points, axis=-1).ravel()
    r = r[(r > 1e-9) & (r < re)]
    return float(weight.values(r, re).sum())


def test_the_isochoric_weight_measures_volume():
    """The same n for other arrangements of the same volume, within 0.1 %, and within 0.9 % for stretched ones."""
    weight = next(w for w in WEIGHTS if w.key == "isochoric")
    cells = np.stack(np.meshgrid(*[np.arange(-5.0, 6.0)] * 2), axis=-1)
    n0 = _sum_at(cells, weight)
    side = math.sqrt(2 / math.sqrt(3))
    hexagonal = side * (cells @ np.array([[1.0, 0.0], [0.5, math.sqrt(3) / 2]]))
    assert _sum_at(hexagonal, weight) == pytest.approx(n0, rel=1e-3)
    for stretch, angle in itertools.product((1.05, 1.1, 1.2, 1.3, 1.5), (0.0, math.pi / 8, math.pi / 4)):
        c, s = math.cos(angle), math.sin(angle)
        moved = cells @ np.array([[c, s], [-s, c]]) * [stretch, 1 / stretch]
        assert _sum_at(moved, weight) == pytest.approx(n0, rel=9e-3)


def _double_loop(weight, re, d):
    n0 = second = 0.0
    for cell in itertools.product(range(-7, 8), repeat=d):
        r = math.sqrt(sum(c * c for c in cell))
        if 0 < r < re:
            w = float(weight.values(r, re))
            n0 += w
            second += w * r * r
    return n0, second / n0


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("re", [2.1, 3.1])
@pytest.mark.parametrize("weight", WEIGHTS, ids=lambda w: w.key)
def test_reference_sums(weight, re, d):
    n0, lambda_ = _double_loop(weight, re, d)
    for spacing in (1.0, 0.005):
        lattice = Lattice(d, spacing)
        assert lattice.n0(weight, re) == pytest.approx(n0, rel=1e-12)
        assert lattice.lambda_(weight, re) == pytest.approx(lambda_ * spacing**2, rel=1e-12)


def test_known_number_densities():
    # Inverse weight, re = 2.1: 4 neighbours at 1, 4 at sqrt 2, 4 at 2; in 3D 6, 12, 8 at sqrt 3 and 6.
    assert Lattice(2, 0.1).n0(Inverse(), 2.1) == pytest.approx(4 * 1.1 + 4 * (2.1 / math.sqrt(2) - 1) + 4 * 0.05)
    expected = 6 * 1.1 + 12 * (2.1 / math.sqrt(2) - 1) + 8 * (2.1 / math.sqrt(3) - 1) + 6 * 0.05
    assert Lattice(3, 0.1).n0(Inverse(), 2.1) == pytest.approx(expected)


def test_weights_in_the_kernel_language(every_runtime):
    """NumPy and the kernel language agree on every weight."""
    re, n = 0.21, 200
    distances = np.linspace(0.02, 0.2099, n)
    real = every_runtime.real
    Reals = kernels.array_type(real)
    source, target = kernels.array(real, n), kernels.array(real, n)
    source.from_numpy(distances.astype(every_runtime.dtype))
    tolerance = 1e-12 if every_runtime.precision == "double" else 2e-5
    for weight in WEIGHTS:
        function = weight.function()

        @kernels.kernel
        def evaluate(r: Reals, out: Reals, re: real, function: kernels.qd.template()):
            for i in range(200):
                out[i] = function(r[i], re)

        evaluate(source, target, re, function)
        assert target.to_numpy() == pytest.approx(weight.values(distances, re), rel=tolerance, abs=tolerance)
