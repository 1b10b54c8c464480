"""Viscosity, explicit and implicit, and turbulence: exact profiles, decay, momentum, any time step."""

from itertools import product

import numpy as np
import pytest

import asked
from arrangements import block, table
from reference.cloud import Cloud
from spume.lattice import Lattice
from spume.particles import DUMMY, FLUID, WALL
from spume.pressure.conjugate_gradient import ConjugateGradient
from spume.pressure.matrix import SYSTEM_FIELDS
from spume.problems import CaseError
from spume.schemes.laplacian.distance import Distance
from spume.schemes.laplacian.higher_order import HigherOrder
from spume.schemes.laplacian.least_squares import LeastSquares
from spume.schemes.laplacian.original import Original
from spume.schemes.laplacian.second_order import SecondOrder
from spume.schemes.turbulence.smagorinsky import Smagorinsky
from spume.schemes.viscosity.explicit import Explicit
from spume.schemes.viscosity.implicit import Implicit
from spume.wall_models.base import WALL_FIELDS

pytestmark = pytest.mark.usefixtures("runtime")
TURBULENT = Smagorinsky(constant=0.2)
TRUSTING = Smagorinsky(constant=0.2, floor=1e-3)
FIELDS = tuple(
    dict.fromkeys((*SYSTEM_FIELDS, *WALL_FIELDS, *Implicit.needs, *ConjugateGradient.needs, *Smagorinsky.needs))
)
CELLS = 10
TIGHT = Implicit(solver=ConjugateGradient(tolerance=1e-11))


def box(**rows):
    """Return (lattice, particles, pairs) of a periodic square of 10 x 10 rows, spacing 0.1 m."""
    position = block(2, CELLS)
    return table(position, fields=FIELDS, region=([-0.5] * 2, [0.5] * 2), periodic=[True] * 2, skin=0.1, **rows)


def channel(speed=1.0, cells=CELLS):
    """Return a plane channel between y = 0 and 1 whose upper plate moves."""
    y = (np.arange(-3, cells + 3) + 0.5) / cells
    x = (np.arange(7) + 0.5) / cells
    position = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    height = position[:, 1]
    depth = np.maximum(np.maximum(-height, height - 1), 0.0)
    kind = np.select([depth == 0, depth < 1 / cells], [FLUID, WALL], DUMMY)
    towards = np.where(height > 1, -depth, depth)
    wall = np.zeros_like(position)
    wall[height > 1, 0] = speed
    rows = {"kind": kind, "to_surface": np.stack([0 * depth, towards], axis=1), "wall_velocity": wall}
    return table(
        position, 1 / cells, fields=FIELDS, region=([0.0, -0.4], [7 / cells, 1.4]), periodic=[True, False], skin=0.1,
        **rows,
    )  # fmt: skip


def step(viscosity, domain, dt, force=0.0):
    lattice, particles, pairs = domain
    acceleration = np.zeros((particles.count, 2))
    acceleration[:, 0] = force
    particles.set("acceleration", acceleration)
    viscosity(lattice, particles, pairs, dt)
    fluid = (particles.numpy("kind") == FLUID)[:, None]
    particles.set("velocity", particles.numpy("velocity") + fluid * dt * particles.numpy("acceleration"))


def set_viscosity(particles, nu):
    particles.set("kinematic_viscosity", np.broadcast_to(nu, particles.count))


@pytest.mark.parametrize(("dt", "steps"), [(0.1, 60), (100.0, 3)])
def test_implicit_poiseuille_and_couette_at_any_time_step(dt, steps):
    """The steady profile, whatever dt: 10 and 10 000 times the explicit limit; exact but for the curvature at walls."""
    nu, force = 0.5, 2.0
    domain = channel()
    _, particles, _ = domain
    set_viscosity(particles, nu)
    assert dt > 9 * Explicit().max_dt(domain[0], nu)
    for _ in range(steps):
        step(TIGHT, domain, dt)
    y, fluid = particles.numpy("position")[:, 1], particles.numpy("kind") == FLUID
    assert particles.numpy("velocity")[fluid, 0] == pytest.approx(y[fluid], abs=1e-5), "Couette: linear, exact"
    for _ in range(steps):
        step(TIGHT, domain, dt, force)
    profile = y + force / (2 * nu) * y * (1 - y)
    assert particles.numpy("velocity")[fluid, 0] == pytest.approx(profile[fluid], abs=0.03 * force / (8 * nu))
    assert particles.numpy("velocity")[fluid, 1] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("limits", [0.2, 20.0])
def test_decay_of_a_wave_of_shear(limits):
    """u_x = sin(2 pi y) is an eigenvector: explicit loses nu k dt a step, implicit divides by 1 + nu k dt."""
    domain = box()
    lattice, particles, _ = domain
    nu = 0.3
    set_viscosity(particles, nu)
    y = particles.numpy("position")[:, 1]
    wave = np.stack([np.sin(2 * np.pi * y), 0 * y], axis=1)
    particles.set("velocity", wave)
    particles.set("slip_velocity", wave)
    particles.set("acceleration", np.zeros_like(wave))
    Explicit()(*domain, 1.0)
    rate = -(particles.numpy("acceleration") * wave).sum() / (wave**2).sum()
    assert rate == pytest.approx(nu * (2 * np.pi) ** 2, rel=0.06)
    dt = limits * Explicit().max_dt(lattice, nu)
    for count in (1, 2):
        step(TIGHT, domain, dt)
        assert particles.numpy("velocity") == pytest.approx(wave / (1 + rate * dt) ** count, abs=1e-8)


def largest_eigenvalue(laplacian, d):
    """Return k l0^2 of the wave that an explicit step of the viscosity amplifies first, on the lattice."""
    cells = {2: 12, 3: 10}[d]
    cloud = Cloud(d, re=3.1, disturbance=0.0, cells=cells)
    cloud.period = cells * cloud.l0
    row = asked.system(laplacian, cloud)[0][0]
    offsets = (cloud.x - cloud.x[0]) / cloud.l0
    offsets -= cells * np.round(offsets / cells)
    waves = np.array(list(product(np.linspace(0.0, np.pi, 21), repeat=d)))
    return (row * np.cos(waves @ offsets.T)).sum(axis=1).max() * cloud.l0**2


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize(
    ("laplacian", "parts"),
    [
        (Original(), (0.24, 0.17)),
        (Distance(), (0.34, 0.25)),
        (HigherOrder(), (0.23, 0.17)),
        (HigherOrder(form="consistent"), (0.32, 0.18)),
        (HigherOrder(form="published"), (0.49, 0.18)),
        (SecondOrder(), (0.13, 0.08)),
        (LeastSquares(), (0.09, 0.07)),
    ],
    ids=lambda value: getattr(value, "key", None),
)
def test_part_of_the_limit_of_stability(laplacian, parts, d):
    """Of the limit 2/(nu k) on the lattice."""
    limit = 2.0 / largest_eigenvalue(laplacian, d)
    assert Explicit().max_dt(Lattice(d, 1.0), 1.0) / limit == pytest.approx(parts[d - 2], abs=0.006)


def test_implicit_conserves_momentum_and_takes_energy():
    """Between rows of different viscosities and densities, far above the explicit limit."""
    rng = np.random.default_rng(3)
    domain = box(density=rng.choice([1.0, 100.0], CELLS**2))
    _, particles, _ = domain
    set_viscosity(particles, rng.choice([0.001, 2.0], CELLS**2))
    velocity = rng.normal(size=(CELLS**2, 2))
    particles.set("velocity", velocity)
    rho = particles.numpy("density")[:, None]
    step(TIGHT, domain, 10.0)
    after = particles.numpy("velocity")
    assert (rho * after).sum(axis=0) == pytest.approx(
        (rho * velocity).sum(axis=0), abs=1e-6 * (rho * abs(velocity)).sum()
    )
    assert (rho * after**2).sum() < 0.5 * (rho * velocity**2).sum()


def test_two_layers_of_different_viscosity():
    """Couette flow: the stress is the same in both, so the slopes are as the inverse viscosities."""
    domain = channel()
    _, particles, _ = domain
    y, fluid = particles.numpy("position")[:, 1], particles.numpy("kind") == FLUID
    set_viscosity(particles, np.where(y < 0.5, 0.1, 1.0))
    for _ in range(3):
        step(TIGHT, domain, 1e4)
    between = 0.5 / 0.1 / (0.5 / 0.1 + 0.5 / 1.0)
    exact = np.where(y < 0.5, 2 * between * y, 1 - 2 * (1 - between) * (1 - y))
    assert particles.numpy("velocity")[fluid, 0] == pytest.approx(exact[fluid], abs=0.03)


def test_water_at_rest_feels_no_viscosity():
    """Gravity is balanced by the pressure of the step before: nothing is diffused from the walls."""
    domain = channel(speed=0.0)
    lattice, particles, pairs = domain
    set_viscosity(particles, 1.0)
    gravity = np.broadcast_to([0.0, -9.81], (particles.count, 2))
    particles.set("acceleration", gravity)
    particles.set("pressure_gradient", 1000.0 * gravity)
    TIGHT(lattice, particles, pairs, 1.0)
    assert particles.numpy("acceleration") == pytest.approx(gravity, abs=1e-9)


@pytest.mark.parametrize("disturbance", [0.0, 0.3])
@pytest.mark.parametrize("d", [2, 3])
def test_eddy_viscosity_of_a_linear_flow(d, disturbance):
    """nu_t = (C_s l0)^2 (2 S:S)^(1/2), exact on any arrangement; a rotation has none."""
    fields = (*FIELDS,)
    lattice, particles, pairs = table(block(d, 6, disturbance=disturbance), fields=fields, skin=0.1)
    set_viscosity(particles, 1e-3)
    rng = np.random.default_rng(5)
    gradient = rng.normal(size=(d, d))
    for matrix in (gradient, gradient - gradient.T):
        particles.set("slip_velocity", particles.numpy("position") @ matrix.T)
        assert TRUSTING(lattice, particles, pairs) == "effective_viscosity"
        strain = 0.5 * (matrix + matrix.T)
        expected = 1e-3 + (0.2 * 0.1) ** 2 * np.sqrt(2 * (strain**2).sum())
        assert particles.numpy("effective_viscosity") == pytest.approx(expected, rel=1e-9)
    assert TRUSTING.largest(particles) == pytest.approx(1e-3)
    viscosity = Explicit(turbulence=TURBULENT)
    particles.set("effective_viscosity", np.full(particles.count, 0.7))
    assert viscosity.largest(particles, 1e-3) == pytest.approx(0.7)


def test_turbulence_adds_to_both_viscosities():
    domain = box()
    lattice, particles, pairs = domain
    set_viscosity(particles, 1e-3)
    y = particles.numpy("position")[:, 1]
    wave = np.stack([np.sin(2 * np.pi * y), 0 * y], axis=1)
    turbulent = (Explicit(turbulence=TURBULENT), TIGHT.model_copy(update={"turbulence": TURBULENT}))
    for laminar, viscosity in zip((Explicit(), TIGHT), turbulent, strict=True):
        found = []
        for model in (laminar, viscosity, laminar):
            particles.set("velocity", wave)
            particles.set("slip_velocity", wave)
            particles.set("acceleration", np.zeros_like(wave))
            model(lattice, particles, pairs, 1e-3)
            found.append(particles.numpy("acceleration"))
            if model is viscosity:
                set_viscosity(particles, particles.numpy("effective_viscosity"))
        assert found[2] == pytest.approx(found[1], abs=1e-9), "as a liquid of that viscosity"
        assert np.abs(found[1]).max() > 2 * np.abs(found[0]).max()
        set_viscosity(particles, 1e-3)


def test_an_inconsistent_solver_is_refused():
    with pytest.raises(CaseError, match="'cg' needs a symmetric matrix, which the laplacian 'second-order'"):
        Implicit(laplacian=SecondOrder())


@pytest.mark.parametrize("apart", [1.0, 0.5, 0.3, 0.1, 0.01])
def test_a_pair_that_nearly_touches_is_not_thrown_apart(apart):
    """The longest step that viscosity allows leaves no pair a larger relative velocity, and its momentum as it was."""
    x = np.array([[0.0, 0.0], [0.1 * apart, 0.0]])
    domain = table(x, fields=FIELDS, velocity=[[1.0, 0.5], [-1.0, 0.0]])
    _, particles, _ = domain
    set_viscosity(particles, 1e-2)
    viscosity = Explicit(laplacian=Distance())
    particles.set("slip_velocity", particles.numpy("velocity"))
    step(viscosity, domain, viscosity.max_dt(domain[0], 1e-2))
    u = particles.numpy("velocity")
    assert u.sum(axis=0) == pytest.approx([0.0, 0.5], abs=1e-12)
    assert np.linalg.norm(u[0] - u[1]) < np.linalg.norm([2.0, 0.5])


@pytest.mark.parametrize("d", [2, 3])
def test_spray_has_hardly_any_eddies(d):
    """Rows that lie nearly in a line say nothing of a gradient across it, however fast they part."""
    line = np.zeros((4, d))
    line[:, 0] = [0.0, 0.1, 0.21, 0.3]
    line[:, 1] = [0.0, 0.001, -0.001, 0.0]
    lattice, particles, pairs = table(line, fields=FIELDS, skin=0.1)
    set_viscosity(particles, 0.0)
    u = np.zeros((4, d))
    u[:, 1] = [0.0, 1.0, -1.0, 0.5]
    order = particles.numpy("id")
    particles.set("slip_velocity", u[order])
    TURBULENT(lattice, particles, pairs)
    assert particles.numpy("effective_viscosity").max() < (0.2 * 0.1) ** 2 * 20.0
