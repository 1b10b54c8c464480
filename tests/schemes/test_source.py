"""Right sides of the pressure equation, by their formulas, through steps of different length."""

import numpy as np
import pytest

import spume
from arrangements import block, inside, offsets, table, weights
from spume.build import build
from spume.particles import DUMMY, FLUID, WALL
from spume.schemes.divergence.original import Original as OriginalDivergence
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.number_density.base import Original as NumberDensity
from spume.schemes.source.base import DIVERGENCE, SOURCE
from spume.schemes.source.density import Density
from spume.schemes.source.divergence import VelocityDivergence
from spume.schemes.source.divergence_density import VOLUME_ERROR, DivergenceDensity
from spume.schemes.source.error_compensating import ErrorCompensating
from spume.schemes.source.higher_order import HigherOrder
from spume.schemes.source.three_term import ThreeTerm
from spume.schemes.weight.wendland import Wendland
from spume.steps.base import solve_pressure
from spume.steps.predict_move_project import PredictMoveProject
from spume.steps.project_in_place import ProjectInPlace

pytestmark = pytest.mark.usefixtures("runtime")
DT = 0.02


@pytest.fixture
def state():
    """A disturbed block of every kind with random velocities, n and div u."""
    rng = np.random.default_rng(1)
    lattice, particles, pairs = table(
        block(2, 10, disturbance=0.3), fields=(SOURCE, DIVERGENCE, SURFACE_SHARE, VOLUME_ERROR),
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


# ---------------------------------------------------------------------- by the rate of the number density

NEEDS = (SOURCE, DIVERGENCE, SURFACE_SHARE, *ErrorCompensating.needs, *ThreeTerm.needs)


def rate_of(particles, weight, mirror=False):
    """Return Dn/Dt of every row by the double sum, solid neighbours as mirror images if asked for."""
    r, u = offsets(particles.numpy("position")), particles.numpy("velocity")
    s = np.maximum(np.linalg.norm(r, axis=-1), 1e-30)
    h = 1e-6 * s
    slope = (weights(r * (1 + 1e-6), weight, 0.21) - weights(r * (1 - 1e-6), weight, 0.21)) / (2 * h)
    difference = u[None] - u[:, None]
    if mirror:
        outward = particles.numpy("to_surface")
        n = outward / np.maximum(np.linalg.norm(outward, axis=1), 1e-30)[:, None]
        solid = particles.numpy("kind") != FLUID
        image = 2 * np.einsum("ijk,jk->ij", difference, n)[..., None] * n[None]
        difference = np.where(solid[None, :, None], image, difference)
    return (slope * np.einsum("ijk,ijk->ij", r, difference) / s).sum(axis=1)


def crowd(d, seed=1, kinds=(FLUID,)):
    """Return a disturbed block with random velocities; re = 2.1 l0 cuts no pair within 1e-6 of it."""
    rng = np.random.default_rng(seed)
    n = 10**2 if d == 2 else 6**3
    return table(
        block(d, 10 if d == 2 else 6, disturbance=0.3), fields=NEEDS, kind=rng.choice(kinds, n),
        velocity=rng.normal(size=(n, d)), to_surface=rng.normal(size=(n, d)),
    )  # fmt: skip


@pytest.mark.parametrize("weight", [NumberDensity().weight, Wendland()], ids=["inverse", "wendland"])
@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("d", [2, 3])
def test_higher_order(d, mirror, weight):
    lattice, particles, pairs = crowd(d, kinds=(FLUID, FLUID, WALL, DUMMY))
    number_density = NumberDensity(weight=weight)
    HigherOrder()(lattice, particles, pairs, DT, None, number_density, mirror)
    expected = -rate_of(particles, weight, mirror) / (number_density.n0(lattice) * DT)
    rows = (particles.numpy("kind") & (FLUID | WALL)) != 0
    assert particles.numpy("source")[rows] == pytest.approx(expected[rows], rel=1e-6, abs=1e-4)


@pytest.mark.parametrize(("d", "factor"), [(2, 1.417), (3, 1.073)])
def test_compression_by_the_rate_of_the_number_density(d, factor):
    """On the lattice div(u)/dt times sum(re/r)/(d n0), the factor of the higher-order Laplacian."""
    cells = 9 if d == 2 else 7
    position = block(d, cells)
    lattice, particles, pairs = table(position, fields=NEEDS, velocity=-2.0 * position)
    HigherOrder()(lattice, particles, pairs, DT, None, NumberDensity(), False)
    core = inside(particles.numpy("position"), cells)
    assert particles.numpy("source")[core] == pytest.approx(-2.0 * d / DT * factor, rel=1e-3)


def turned(position, angle):
    """Return the points turned about the origin, which brings the rows into another order and leaves n alone."""
    c, s = np.cos(angle), np.sin(angle)
    result = position.copy()
    result[:, 0], result[:, 1] = c * position[:, 0] - s * position[:, 1], s * position[:, 0] + c * position[:, 1]
    return result


def by_id(particles, name):
    return particles.numpy(name)[np.argsort(particles.numpy("id"))]


def give(particles, name, values):
    """Set a field from values in the order of the ids."""
    particles.set(name, values[particles.numpy("id")])


def size_at(t):
    """Return by what factor the block has grown at the time t [s]."""
    return 1.0 + 0.04 * np.sin(25.0 * t)


@pytest.mark.parametrize("d", [2, 3])
def test_three_terms_through_steps_of_different_length(d):
    """A block that breathes and turns: n^(k-1), n^k and n* are those of its sizes, whatever the order of rows."""
    source, number_density = ThreeTerm(alpha=0.3, beta=0.1), NumberDensity()
    lattice, particles, pairs = table(block(d, 10 if d == 2 else 6, disturbance=0.2), fields=NEEDS)
    shape = by_id(particles, "position")
    n0 = number_density.n0(lattice)
    shares = np.random.default_rng(2).choice([0.0, 0.5], len(shape))

    def place(t, growth=0.0):
        give(particles, "position", turned(shape * (size_at(t) + growth), 20.0 * t))
        pairs.update(particles)
        give(particles, "surface_share", shares)
        r = offsets(by_id(particles, "position"))
        return weights(r, number_density.weight, 0.21).sum(axis=1)

    t, before, dt_before, orders = 0.0, None, None, set()
    for dt in (0.02, 0.03, 0.01, 0.016, 0.016):
        start = place(t)
        source.remember(lattice, particles, pairs, number_density, False)
        after = place(t, growth=-0.5 * dt)
        number_density(lattice, particles, pairs)
        source(lattice, particles, pairs, dt, None, number_density, False)
        rate = 0.0 if before is None else (start - before) / dt_before
        error = (start - n0) / n0
        error = np.where(error < 0, error * (1 - shares), error)
        expected = -((after - start) / dt - rate + 0.3 * rate) / (n0 * dt) - 0.1 * error / dt**2
        assert by_id(particles, "source") == pytest.approx(expected, rel=1e-9, abs=1e-6)
        orders.add(tuple(particles.numpy("id")))
        t, before, dt_before = t + dt, start, dt
    assert len(orders) > 2, "the rows were sorted anew"


def test_three_terms_of_full_weight_are_the_density_source():
    """With steps of one length; after a change of dt the shares of the rate differ."""
    number_density = NumberDensity()
    lattice, particles, pairs = table(block(2, 10, disturbance=0.2), fields=NEEDS)
    source = ThreeTerm(alpha=1.0, beta=1.0)
    for growth in (1.0, 0.99, 0.985):
        source.remember(lattice, particles, pairs, number_density, False)
        particles.set("position", growth * particles.numpy("position"))
        pairs.update(particles)
        number_density(lattice, particles, pairs)
        source(lattice, particles, pairs, DT, None, number_density, False)
        found = by_id(particles, "source")
        Density()(lattice, particles, pairs, DT, None, number_density, False)
        assert found == pytest.approx(by_id(particles, "source"), rel=1e-9, abs=1e-6)


@pytest.mark.parametrize("d", [2, 3])
def test_error_compensation(d):
    """n^k and Dn/Dt at the start, Dn/Dt after the motion, and the rows in another order in between."""
    source, number_density = ErrorCompensating(), NumberDensity()
    lattice, particles, pairs = crowd(d)
    n0 = number_density.n0(lattice)
    source.remember(lattice, particles, pairs, number_density, False)
    r = offsets(by_id(particles, "position"))
    error = (weights(r, number_density.weight, 0.21).sum(axis=1) - n0) / n0
    start = rate_of(particles, number_density.weight)[np.argsort(particles.numpy("id"))] / n0
    give(particles, "position", turned(by_id(particles, "position"), 1.3))
    pairs.update(particles)
    give(particles, "velocity", np.random.default_rng(5).normal(size=(particles.count, d)))
    source(lattice, particles, pairs, DT, None, number_density, False)
    after = rate_of(particles, number_density.weight)[np.argsort(particles.numpy("id"))] / n0
    expected = -(after + np.abs(error) * start + np.abs(DT * start) * error / DT) / DT
    size = np.abs(expected).max()
    assert by_id(particles, "source") == pytest.approx(expected, abs=1e-7 * size)
    assert np.abs(expected + after / DT).max() > 0.05 * size, "the compensation is no trifle here"


# ---------------------------------------------------------------------------------------- compressibility


@pytest.mark.parametrize(
    ("step", "source", "kept"),
    [
        (ProjectInPlace, DivergenceDensity, 1.0),
        (PredictMoveProject, Density, 0.0),
        (PredictMoveProject, ThreeTerm, 1.0),
    ],
)
def test_relative_compressibility(device, step, source, kept):
    """-alpha_c (P - P_0)/dt^2 = source where nothing varies: also a closed fluid has a definite pressure."""
    alpha, dt, before, crowding = 4.5e-10, 1e-3, 800.0, 1e-6
    box = spume.Box(lower=[0.0, 0.0], upper=[1.0, 1.0])
    case = spume.Case(
        spacing=0.1, time=spume.Time(end=1.0), fluid=[spume.Fluid(name="water", shape=box)],
        domain=spume.Domain(periodic=["x", "y"], lower=[0.0, 0.0], upper=[1.0, 1.0], gravity=[0.0, 0.0]),
        step=step(source=source(compressibility=alpha)),
    )  # fmt: skip
    simulation = build(case, device=device, threads=1)
    domain, step = simulation.domain, simulation.step
    lattice, particles, pairs = domain.lattice, domain.particles, domain.pairs
    pairs.update(particles)
    n0 = step.number_density.n0(lattice)
    for name, value in (("fluid_neighbours", 9), ("pressure", before), ("number_density", n0 * (1.0 + crowding))):
        particles.set(name, np.full(particles.count, value))
    if source is ThreeTerm:  # crowded by this step alone
        particles.set("number_density_start", np.full(particles.count, n0))
    step.source(lattice, particles, pairs, dt, step.divergence, step.number_density, False)
    solve_pressure(step, domain, 0.0, dt * dt)
    corrected = 0.05 * crowding if source is DivergenceDensity else crowding
    assert particles.numpy("pressure") == pytest.approx(kept * before + corrected / alpha, rel=1e-6)
