"""Right sides of the pressure equation, by their formulas."""

import numpy as np
import pytest

from arrangements import block, table
from spume.particles import DUMMY, FLUID, WALL
from spume.schemes.divergence.original import Original as OriginalDivergence
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.number_density.base import Original as NumberDensity
from spume.schemes.source.base import DIVERGENCE, SOURCE
from spume.schemes.source.density import Density
from spume.schemes.source.divergence import VelocityDivergence
from spume.schemes.source.divergence_density import DivergenceDensity

pytestmark = pytest.mark.usefixtures("runtime")
DT = 0.02


@pytest.fixture
def state():
    """A disturbed block of every kind with random velocities, n and div u."""
    rng = np.random.default_rng(1)
    lattice, particles, pairs = table(
        block(2, 10, disturbance=0.3), fields=(SOURCE, DIVERGENCE, SURFACE_SHARE),
        kind=rng.choice([FLUID, FLUID, WALL, DUMMY], 100), velocity=rng.normal(size=(100, 2)),
        surface_share=rng.choice([0.0, 0.4, 1.0], 100),
    )  # fmt: skip
    number_density = NumberDensity()
    number_density(lattice, particles, pairs)
    divergence = OriginalDivergence()
    divergence(lattice, particles, pairs, out="answer")
    return lattice, particles, pairs, number_density, divergence


def source_of(source, lattice, particles, pairs, number_density, divergence):
    source(lattice, particles, pairs, DT, divergence, number_density, False)
    rows = (particles.numpy("kind") & (FLUID | WALL)) != 0
    ratio = particles.numpy("number_density") / number_density.n0(lattice)
    return particles.numpy("source")[rows], ratio[rows], particles.numpy("answer")[rows], rows, particles


def test_density(state):
    found, ratio, _, _, _ = source_of(Density(), *state)
    assert found == pytest.approx((1.0 - ratio) / DT**2, rel=1e-10, abs=1e-9)


def test_divergence(state):
    found, _, divergence, _, _ = source_of(VelocityDivergence(), *state)
    assert found == pytest.approx(divergence / DT, rel=1e-10)


@pytest.mark.parametrize("gamma", [0.0, 0.05, 1.0])
def test_divergence_and_density(state, gamma):
    """Where rows lack neighbours on the surface, n < n0 is no error of the volume."""
    found, ratio, divergence, rows, particles = source_of(DivergenceDensity(gamma=gamma), *state)
    share = particles.numpy("surface_share")[rows]
    error = 1.0 - ratio
    error = np.where(error > 0, error * (1.0 - share), error)
    assert (error > 0).any()
    assert (error < 0).any()
    assert found == pytest.approx(divergence / DT + gamma * error / DT**2, rel=1e-9, abs=1e-9)


def test_compression_makes_it_negative(state):
    lattice, particles, pairs, number_density, divergence = state
    particles.set("velocity", -particles.numpy("position"))
    found, *_ = source_of(VelocityDivergence(), lattice, particles, pairs, number_density, divergence)
    assert np.all(found < 0)
