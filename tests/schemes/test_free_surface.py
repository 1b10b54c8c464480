"""Number density and detection of the free surface."""

import numpy as np
import pytest

from arrangements import block, inside, offsets, table, weights
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.free_surface.blended import Blended
from spume.schemes.free_surface.number_density import LowNumberDensity
from spume.schemes.number_density.base import Original as NumberDensity

pytestmark = pytest.mark.usefixtures("runtime")


def detected(surface, position, re=2.1):
    lattice, particles, pairs = table(position, fields=(SURFACE_SHARE,), reach=max(re, 2.1))
    number_density = NumberDensity(re=re)
    number_density(lattice, particles, pairs)
    surface(lattice, particles, pairs, number_density)
    return lattice, particles, number_density


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("re", [2.1, 3.1])
def test_number_density(d, re):
    """n by a direct sum; n0 inside the regular arrangement."""
    cells = 9
    for disturbance in (0.0, 0.3):
        position = block(d, cells if d == 2 else 8, disturbance=disturbance)
        lattice, particles, number_density = detected(LowNumberDensity(), position, re)
        w = weights(offsets(particles.numpy("position")), number_density.weight, re * 0.1)
        assert particles.numpy("number_density") == pytest.approx(w.sum(axis=1), rel=1e-10)
        if disturbance == 0.0:
            core = inside(particles.numpy("position"), cells if d == 2 else 8, reach=re)
            expected = number_density.n0(lattice)
            assert particles.numpy("number_density")[core] == pytest.approx(expected, rel=1e-10)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("surface", [LowNumberDensity(), Blended()], ids=lambda s: s.key)
def test_the_surface_of_a_block_is_its_outer_layer(surface, d):
    cells = 9 if d == 2 else 7
    _, particles, _ = detected(surface, block(d, cells))
    outer = np.any(np.abs(particles.numpy("position")) > (cells / 2 - 1) * 0.1, axis=1)
    assert np.array_equal(particles.numpy("free_surface") == 1, outer)


def test_below_beta():
    lattice, particles, number_density = detected(LowNumberDensity(beta=0.8), block(2, 9, disturbance=0.3))
    low = particles.numpy("number_density") < 0.8 * number_density.n0(lattice)
    assert np.array_equal(particles.numpy("free_surface") == 1, low)
    assert np.array_equal(particles.numpy("surface_share"), low.astype(float))


def test_share_falls_from_one_to_nothing():
    surface = Blended(upper=0.95, lower=0.7)
    lattice, particles, number_density = detected(surface, block(2, 12, disturbance=0.35))
    ratio = particles.numpy("number_density") / number_density.n0(lattice)
    expected = np.clip((0.95 - ratio) / 0.25, 0, 1)
    assert ((expected > 0) & (expected < 1)).any()
    assert particles.numpy("surface_share") == pytest.approx(expected, abs=1e-12)
    assert np.array_equal(particles.numpy("free_surface") == 1, expected > 0.5)
