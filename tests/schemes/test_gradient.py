"""Gradient models: exact on the polynomials that they claim."""

import numpy as np
import pytest

from arrangements import block, inside, offsets, table, weights
from spume import named
from spume.pairs import PairView
from spume.particles import FLUID, WALL
from spume.schemes import discover
from spume.schemes.correction import CORRECTION
from spume.schemes.free_surface.base import SURFACE_SHARE

discover()
GRADIENTS = {scheme.key: scheme() for scheme in named.schemes("gradient")}
FIELDS = [CORRECTION, SURFACE_SHARE, *(f for g in GRADIENTS.values() for f in getattr(g, "needs", ()))]
SLOPES = {2: np.array([3.0, -2.0]), 3: np.array([3.0, -2.0, 0.5])}

pytestmark = pytest.mark.usefixtures("runtime")
schemes = pytest.mark.parametrize("gradient", GRADIENTS.values(), ids=GRADIENTS)
dimensions = pytest.mark.parametrize("d", [2, 3])


def arrangement(d, disturbance, **rows):
    cells = 10 if d == 2 else 7
    lattice, particles, pairs = table(block(d, cells, disturbance=disturbance), fields=FIELDS, **rows)
    core = inside(particles.numpy("position"), cells, disturbance=disturbance)
    assert core.sum() >= 20 if d == 2 else core.any()
    return lattice, particles, pairs, core


def gradient_of(gradient, lattice, particles, pairs, phi):
    particles.set("scalar", phi)
    particles.set("vector", np.full((particles.count, particles.dimension), np.nan))
    gradient(lattice, particles, pairs, phi="scalar", out="vector")
    return particles.numpy("vector")


@schemes
@dimensions
def test_claims(gradient, d):
    """A model of order 0 gives nothing for constants on any arrangement; one of order 1 is exact for linear fields."""
    lattice, particles, pairs, _ = arrangement(d, 0.3)
    found = gradient_of(gradient, lattice, particles, pairs, np.full(particles.count, 7.0))
    assert found == pytest.approx(0.0, abs=1e-10)
    if gradient.order >= 1:
        phi = 5.0 + particles.numpy("position") @ SLOPES[d]
        found = gradient_of(gradient, lattice, particles, pairs, phi)
        assert found == pytest.approx(np.broadcast_to(SLOPES[d], found.shape), rel=1e-10)


@schemes
@dimensions
def test_linear_fields_on_the_regular_arrangement(gradient, d):
    lattice, particles, pairs, core = arrangement(d, 0.0)
    phi = 5.0 + particles.numpy("position") @ SLOPES[d]
    found = gradient_of(gradient, lattice, particles, pairs, phi)[core]
    assert found == pytest.approx(np.broadcast_to(SLOPES[d], found.shape), rel=1e-10)


@pytest.mark.parametrize("key", ["corrected", "completed"])
@dimensions
def test_corrected_models_are_exact_inside_a_disturbed_fluid(key, d):
    lattice, particles, pairs, core = arrangement(d, 0.3)
    phi = 5.0 + particles.numpy("position") @ SLOPES[d]
    found = gradient_of(GRADIENTS[key], lattice, particles, pairs, phi)[core]
    assert found == pytest.approx(np.broadcast_to(SLOPES[d], found.shape), rel=1e-9)


@pytest.mark.parametrize("key", ["original", "minimum"])
@dimensions
def test_uncorrected_models_are_not(key, d):
    """Otherwise the test above would show nothing."""
    lattice, particles, pairs, core = arrangement(d, 0.3)
    phi = 5.0 + particles.numpy("position") @ SLOPES[d]
    found = gradient_of(GRADIENTS[key], lattice, particles, pairs, phi)[core]
    assert np.abs(found - SLOPES[d]).max() > 0.1


@dimensions
def test_formulas_of_the_original_models(d):
    """Original and minimum against their sums, on a disturbed arrangement with random values."""
    lattice, particles, pairs, _ = arrangement(d, 0.3)
    phi = np.random.default_rng(3).normal(size=particles.count)
    r = offsets(particles.numpy("position"))
    w = weights(r, GRADIENTS["original"].weight, 0.21)
    share = d / lattice.n0(GRADIENTS["original"].weight, 2.1) * w / np.maximum((r**2).sum(axis=-1), 1e-30)
    difference = phi[None, :] - phi[:, None]
    found = gradient_of(GRADIENTS["original"], lattice, particles, pairs, phi)
    assert found == pytest.approx(((share * difference)[..., None] * r).sum(axis=1), rel=1e-9, abs=1e-9)
    least = np.where((w > 0) | np.eye(len(phi), dtype=bool), phi[None, :], np.inf).min(axis=1)
    above = phi[None, :] - least[:, None]
    found = gradient_of(GRADIENTS["minimum"], lattice, particles, pairs, phi)
    assert found == pytest.approx(((share * above)[..., None] * r).sum(axis=1), rel=1e-9, abs=1e-9)


@dimensions
def test_the_minimum_model_only_repels(d):
    lattice, particles, pairs, _ = arrangement(d, 0.3)
    phi = np.random.default_rng(3).normal(size=particles.count) - 5.0
    gradient = GRADIENTS["minimum"]
    gradient_of(gradient, lattice, particles, pairs, phi)
    w = weights(offsets(particles.numpy("position")), gradient.weight, 0.21)
    near = (w > 0) | np.eye(len(phi), dtype=bool)
    assert np.all(particles.numpy("smallest_value")[:, None] <= np.where(near, phi[None, :], np.inf))


@dimensions
def test_a_flat_surface_of_the_completed_model(d):
    """Pressure zero half a cell outside the surface rows: the full gradient there, too."""
    cells = 10 if d == 2 else 7
    lattice, particles, pairs = table(block(d, cells), fields=FIELDS)
    x = particles.numpy("position")
    depth = cells / 2 * 0.1 - x[:, -1]
    # Two layers lose neighbours with re = 2.1, but the second only the one at 2 l0.
    top = depth < 0.1
    particles.set("surface_share", np.where(top, 1.0, 0.0))
    core = np.all(np.abs(x[:, :-1]) < (cells / 2 - 2.1) * 0.1, axis=1) & (x[:, -1] > 0)
    found = gradient_of(GRADIENTS["completed"], lattice, particles, pairs, 9810.0 * depth)
    expected = np.zeros(d)
    expected[-1] = -9810.0
    assert (core & top).any()
    inner = core & ~top
    assert found[inner] == pytest.approx(np.broadcast_to(expected, found[inner].shape), rel=1e-9, abs=1e-6)
    # Each neighbour stands for its own image, which for the layer at 2 l0 is one spacing off: 0.8 % with re = 2.1.
    surface = found[core & top]
    assert surface[:, -1] == pytest.approx(-9810.0, rel=0.01)
    assert surface[:, :-1] == pytest.approx(0.0, abs=1e-6)


def test_the_completed_model_bounds_what_it_multiplies():
    """A pair alone gives a singular moment matrix: no value may blow up."""
    lattice, particles, pairs = table([[0.0, 0.0], [0.1, 0.0]], fields=FIELDS)
    for gradient in GRADIENTS.values():
        found = gradient_of(gradient, lattice, particles, pairs, np.array([0.0, 1.0]))
        assert np.isfinite(found).all()
        assert np.abs(found).max() <= 1.0 / 0.1 * (1.0 / 0.3) * 1.1 * 2 / lattice.n0(gradient.weight, 2.1)


@schemes
def test_kinds_that_carry_and_walls_that_supply_a_value(gradient):
    """Dummies may be left out, and a wall model may replace what a solid row shows."""
    kind = np.full(100, FLUID)
    kind[::7] = WALL
    lattice, particles, pairs, core = arrangement(2, 0.0, kind=kind)
    phi = 5.0 + particles.numpy("position") @ SLOPES[2]
    solid = particles.numpy("kind") == WALL
    garbage = np.where(solid, 1e6, phi)

    from spume import kernels

    def continued(a, b, r, gx, gy):
        value = b.value
        if b.kind != 1:
            value = a.value + gx * r[0] + gy * r[1]
        return value

    view = PairView(kernels.func(continued), ("value", "kind"), arguments=tuple(SLOPES[2]))
    particles.set("scalar", garbage)
    gradient(lattice, particles, pairs, phi="scalar", out="vector", view=view)
    found = particles.numpy("vector")[core & ~solid]
    assert found == pytest.approx(np.broadcast_to(SLOPES[2], found.shape), rel=1e-9)
    gradient(lattice, particles, pairs, phi="scalar", out="vector", over=FLUID)
    assert np.abs(particles.numpy("vector")[~solid]).max() < 1e3, "a row that carries nothing is not read"
