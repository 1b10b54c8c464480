"""Divergence models: exact on the polynomials that they claim, and what they see of walls."""

import numpy as np
import pytest

from arrangements import block, inside, offsets, table, weights
from spume import named
from spume.particles import DUMMY, FLUID
from spume.schemes import discover
from spume.schemes.correction import CORRECTION, SECOND_MOMENT, WALL_MOMENT
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.velocity_gradient import VELOCITY_GRADIENT

discover()
DIVERGENCES = {scheme.key: scheme() for scheme in named.schemes("divergence")}

pytestmark = pytest.mark.usefixtures("runtime")
schemes = pytest.mark.parametrize("divergence", DIVERGENCES.values(), ids=DIVERGENCES)
dimensions = pytest.mark.parametrize("d", [2, 3])


def arrangement(d, disturbance, **rows):
    cells = 10 if d == 2 else 7
    fields = (CORRECTION, SECOND_MOMENT, WALL_MOMENT, SURFACE_SHARE, VELOCITY_GRADIENT)
    lattice, particles, pairs = table(block(d, cells, disturbance=disturbance), fields=fields, **rows)
    core = inside(particles.numpy("position"), cells, disturbance=disturbance)
    assert core.any()
    return lattice, particles, pairs, core


def divergence_of(divergence, lattice, particles, pairs, velocity, mirror=False):
    particles.set("velocity", velocity)
    particles.set("answer", np.full(particles.count, np.nan))
    divergence(lattice, particles, pairs, out="answer", mirror=mirror)
    return particles.numpy("answer")


def linear(particles, seed=2):
    """Return a velocity field that is linear in space, and its divergence."""
    d = particles.dimension
    slope = np.random.default_rng(seed).normal(size=(d, d))
    return 1.5 + particles.numpy("position") @ slope.T, float(np.trace(slope))


@schemes
@dimensions
def test_claims(divergence, d):
    lattice, particles, pairs, core = arrangement(d, 0.3)
    same = np.broadcast_to([3.0, -1.0, 2.0][:d], (particles.count, d))
    assert divergence_of(divergence, lattice, particles, pairs, same) == pytest.approx(0.0, abs=1e-10)
    velocity, expected = linear(particles)
    found = divergence_of(divergence, lattice, particles, pairs, velocity)
    if divergence.order >= 1:
        assert found == pytest.approx(expected, rel=1e-9)
    elif divergence.key == "blended":
        assert found[core] == pytest.approx(expected, rel=1e-9), "exact inside the fluid"
    elif divergence.key == "bounded":
        free = divergence_of(divergence.model_copy(update={"floor": 0.2}), lattice, particles, pairs, velocity)
        assert free[core] == pytest.approx(expected, rel=1e-9), "exact where the floor does not act"
    else:
        assert np.abs(found[core] - expected).max() > 0.05


@schemes
@dimensions
def test_linear_fields_on_the_regular_arrangement(divergence, d):
    lattice, particles, pairs, core = arrangement(d, 0.0)
    velocity, expected = linear(particles)
    found = divergence_of(divergence, lattice, particles, pairs, velocity)[core]
    assert found == pytest.approx(expected, rel=1e-10)


@dimensions
def test_formula_of_the_original_model(d):
    divergence = DIVERGENCES["original"]
    lattice, particles, pairs, _ = arrangement(d, 0.3)
    velocity = np.random.default_rng(5).normal(size=(particles.count, d))
    r = offsets(particles.numpy("position"))
    w = weights(r, divergence.weight, 0.21)
    difference = velocity[None, :, :] - velocity[:, None, :]
    terms = w * (difference * r).sum(axis=-1) / np.maximum((r**2).sum(axis=-1), 1e-30)
    expected = d / lattice.n0(divergence.weight, 2.1) * terms.sum(axis=1)
    assert divergence_of(divergence, lattice, particles, pairs, velocity) == pytest.approx(expected, abs=1e-9)


@dimensions
def test_the_blended_model_on_the_surface_is_the_original_one(d):
    lattice, particles, pairs, _ = arrangement(d, 0.3)
    velocity = np.random.default_rng(5).normal(size=(particles.count, d))
    original = divergence_of(DIVERGENCES["original"], lattice, particles, pairs, velocity)
    particles.set("surface_share", np.ones(particles.count))
    blended = divergence_of(DIVERGENCES["blended"], lattice, particles, pairs, velocity)
    assert blended == pytest.approx(original, abs=1e-9)


@schemes
@dimensions
def test_solid_rows_move_like_mirror_images(divergence, d):
    """Flow along a wall is no divergence, flow towards it is u_n/l0 and more; only the normal part counts, twice."""
    cells = 10 if d == 2 else 7
    position = block(d, cells)
    solid = position[:, -1] < -0.05
    kind = np.where(solid, DUMMY, FLUID)
    to_surface = np.zeros((len(position), d))
    surface = position[solid, -1].max() + 0.05
    to_surface[solid, -1] = surface - position[solid, -1]
    lattice, particles, pairs, core = arrangement(d, 0.0, kind=kind, to_surface=to_surface)
    x, fluid = particles.numpy("position"), particles.numpy("kind") == FLUID
    first = core & fluid & (x[:, -1] < surface + 0.06)
    assert first.any()
    along = np.zeros((particles.count, d))
    along[fluid, 0] = 2.0
    found = divergence_of(divergence, lattice, particles, pairs, along, mirror=True)
    assert found[first] == pytest.approx(0.0, abs=1e-12)
    towards = np.zeros((particles.count, d))
    towards[fluid, -1] = -2.0
    single = divergence_of(divergence, lattice, particles, pairs, towards, mirror=False)[first]
    double = divergence_of(divergence, lattice, particles, pairs, towards, mirror=True)[first]
    assert np.all(single < -1.0), "compression is negative"
    assert double == pytest.approx(2.0 * single, rel=1e-9)
