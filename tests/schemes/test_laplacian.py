"""Laplacian models in viscosity and in the pressure matrix: exact on the polynomials that they claim."""

import numpy as np
import pytest

from arrangements import cloud, offsets, weights
from spume import named
from spume.particles import FLUID, WALL
from spume.pressure.matrix import ABSENT, FLUX, KNOWN, SYSTEM_FIELDS, UNKNOWN, LinearSystem
from spume.schemes import discover
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.source.base import SOURCE
from spume.schemes.viscosity.explicit import Explicit
from spume.wall_models.base import WALL_FIELDS

discover()
LAPLACIANS = {scheme.key: scheme() for scheme in named.schemes("laplacian")}
FIELDS = (*SYSTEM_FIELDS, SURFACE_SHARE, SOURCE, *WALL_FIELDS)

pytestmark = pytest.mark.usefixtures("runtime")
schemes = pytest.mark.parametrize("laplacian", LAPLACIANS.values(), ids=LAPLACIANS)
dimensions = pytest.mark.parametrize("d", [2, 3])


def arrangement(d, disturbance, **rows):
    return cloud(d, disturbance, FIELDS, **rows)


def polynomials(x):
    """Yield (values, Laplacian) of polynomials up to third degree, which a symmetric lattice gives exactly."""
    yield 3.0 + 2.0 * x[:, 0] - x[:, 1], np.zeros(len(x))
    yield 4.0 * x[:, 0] ** 2 - x[:, 1] ** 2 + 5.0 * x[:, 0] * x[:, 1], np.full(len(x), 6.0)
    yield x[:, 0] ** 3 + x[:, 0] * x[:, 1] ** 2, 8.0 * x[:, 0]
    yield x[:, -1] ** 2, np.full(len(x), 2.0)


def matrix(particles, system):
    """Return the pressure matrix, shape (n, n), and the right side."""
    n = particles.count
    dense = np.zeros((n, n))
    start, length = system.start.to_numpy(), particles.numpy("row_length")
    column, value = system.column.to_numpy(), system.value.to_numpy()
    for i in np.flatnonzero(particles.numpy("row_state") == UNKNOWN):
        slots = slice(start[i], start[i] + length[i])
        np.add.at(dense[i], column[slots], value[slots])
    return dense + np.diag(particles.numpy("diagonal")), particles.numpy("rhs")


@schemes
@dimensions
def test_viscosity_on_the_regular_arrangement(laplacian, d):
    nu = 0.7
    lattice, particles, pairs, core = arrangement(d, 0.0)
    particles.set("kinematic_viscosity", np.full(particles.count, nu))
    for phi, expected in polynomials(particles.numpy("position")):
        velocity = np.zeros((particles.count, d))
        velocity[:, 0], velocity[:, -1] = phi, -2.0 * phi
        particles.set("slip_velocity", velocity)
        particles.set("acceleration", np.ones((particles.count, d)))
        Explicit(laplacian=laplacian)(lattice, particles, pairs, 0.1)
        found = particles.numpy("acceleration")[core]
        assert found[:, 0] == pytest.approx(1.0 + nu * expected[core], rel=1e-9, abs=1e-9)
        assert found[:, -1] == pytest.approx(1.0 - 2.0 * nu * expected[core], rel=1e-9, abs=1e-9)


@schemes
@dimensions
def test_matrix_on_the_regular_arrangement(laplacian, d):
    """Sum_j c_ij/rho (P_i - P_j) = -lap(P)/rho."""
    lattice, particles, pairs, core = arrangement(d, 0.0)
    particles.set("row_state", np.full(particles.count, UNKNOWN))
    system = LinearSystem()
    system.assemble(laplacian, lattice, particles, pairs)
    dense, rhs = matrix(particles, system)
    assert not rhs.any()
    assert np.abs(dense - dense.T).max() < 1e-12 * dense.max()
    assert laplacian.symmetric
    for phi, expected in polynomials(particles.numpy("position")):
        assert (dense @ phi)[core] == pytest.approx(-expected[core] / 1000.0, rel=1e-9, abs=1e-12)


@schemes
@dimensions
def test_matrix_on_a_disturbed_arrangement(laplacian, d):
    """Constants always; a compensated model linear fields too, with the gradient of the step before."""
    lattice, particles, pairs, core = arrangement(d, 0.3)
    n = particles.count
    particles.set("row_state", np.full(n, UNKNOWN))
    slope = np.array([3.0, -2.0, 0.5][:d])
    particles.set("pressure_gradient", np.broadcast_to(slope, (n, d)))
    system = LinearSystem()
    system.assemble(laplacian, lattice, particles, pairs)
    dense, rhs = matrix(particles, system)
    assert dense @ np.full(n, 7.0) == pytest.approx(0.0, abs=1e-10 * dense.max())
    phi = particles.numpy("position") @ slope
    rest = dense @ phi - rhs
    size = np.abs(dense).max() * np.abs(phi).max()
    if laplacian.compensated:
        assert rest == pytest.approx(0.0, abs=1e-12 * size)
        # The compensation fades out towards the free surface.
        particles.set("surface_share", np.ones(n))
        system.assemble(laplacian, lattice, particles, pairs)
        assert not particles.numpy("rhs").any()
    else:
        assert np.abs(rest[core]).max() > 1e-3 * size


@schemes
@dimensions
def test_entries_against_the_formula(laplacian, d):
    """Rows of two densities, and every state: c_ij/rho_ij = 2 d/n0 W/(lambda or r^2)/rho_ij."""
    rng = np.random.default_rng(4)
    n = 10**2 if d == 2 else 7**3
    state = rng.choice([ABSENT, UNKNOWN, UNKNOWN, KNOWN, FLUX], n)
    density = rng.choice([1000.0, 1.0], n)
    kind = np.where(state == FLUX, WALL, FLUID)
    lattice, particles, pairs, _ = arrangement(
        d, 0.3, kind=kind, density=density, row_state=state, source=rng.normal(size=n),
        pressure=rng.normal(size=n), wall_gradient=rng.normal(size=(n, d)),
        surface_diagonal=np.where(rng.uniform(size=n) < 0.3, 0.5, 0.0), surface_value=rng.normal(size=n),
    )  # fmt: skip
    system = LinearSystem()
    system.assemble(laplacian, lattice, particles, pairs)
    dense, rhs = matrix(particles, system)

    state, density = particles.numpy("row_state"), particles.numpy("density")
    r = offsets(particles.numpy("position"))
    w = weights(r, laplacian.weight, 0.21)
    square = np.maximum((r**2).sum(axis=-1), 1e-30)
    if "distance" not in laplacian.key:
        square = np.full_like(square, lattice.lambda_(laplacian.weight, 2.1))
    c = 2 * d / lattice.n0(laplacian.weight, 2.1) * w / square
    c *= 2 / (density[:, None] + density[None, :])
    c[:, state == ABSENT] = 0.0
    unknown = state == UNKNOWN
    both = unknown[:, None] & unknown[None, :]
    draw = particles.numpy("surface_diagonal")
    seen = np.where((state == UNKNOWN) | (state == KNOWN), 1.0, 0.0)
    expected = np.where(both, -c, 0.0) + np.diag(c @ seen + draw)
    rows = np.flatnonzero(unknown)
    assert dense[rows] == pytest.approx(expected[rows], rel=1e-9, abs=1e-12 * c.max())
    flux = (c * np.einsum("ijk,jk->ij", r, particles.numpy("wall_gradient")))[:, state == FLUX].sum(axis=1)
    given = c[:, state == KNOWN] @ particles.numpy("pressure")[state == KNOWN]
    right = -particles.numpy("source") + draw * particles.numpy("surface_value") + given + flux
    assert rhs[rows] == pytest.approx(right[rows], rel=1e-9, abs=1e-12 * np.abs(right).max())
    tied = (draw > 0) | ((c > 0)[:, state == KNOWN]).any(axis=1)
    assert np.array_equal(particles.numpy("grounded")[rows] == 1, tied[rows])


@schemes
def test_viscosity_conserves_momentum(laplacian):
    """Between fluid rows, also of different viscosities."""
    rng = np.random.default_rng(4)
    lattice, particles, pairs, _ = arrangement(2, 0.3, kinematic_viscosity=rng.choice([1e-6, 0.5], 100))
    velocity = rng.normal(size=(100, 2))
    particles.set("slip_velocity", velocity)
    viscosity = Explicit(laplacian=laplacian)
    viscosity(lattice, particles, pairs, 0.1)
    assert "momentum" in viscosity.conserves
    found = particles.numpy("acceleration")
    assert np.abs(found.sum(axis=0)).max() < 1e-12 * np.abs(found).sum()
    assert np.abs(found).max() > 1.0
    assert (found * velocity).sum() < 0, "viscosity takes energy"


def test_stable_time_step_of_viscosity():
    lattice, *_ = arrangement(2, 0.0)
    assert Explicit().max_dt(lattice, 0.5) == pytest.approx(0.01 / (4 * 2 * 0.5))
    assert Explicit().max_dt(lattice, 0.0) == np.inf
