"""Laplacian models in viscosity and in the pressure matrix: exact on the polynomials that they claim."""

import numpy as np
import pytest

from arrangements import block, inside, offsets, table, weights
from spume import named
from spume.particles import DUMMY, FLUID, WALL
from spume.pressure.matrix import ABSENT, FLUX, KNOWN, SYSTEM_FIELDS, UNKNOWN, LinearSystem
from spume.problems import CaseError
from spume.schemes import discover
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.laplacian.corrected_vector import CorrectedVector
from spume.schemes.laplacian.dummy_neighbour import DummyNeighbour
from spume.schemes.laplacian.higher_order import HigherOrder
from spume.schemes.laplacian.second_order import SecondOrder
from spume.schemes.source.base import SOURCE
from spume.schemes.viscosity.explicit import Explicit
from spume.schemes.weight.quadratic import Quadratic
from spume.wall_models.base import WALL_FIELDS

discover()
LAPLACIANS = {scheme.key: scheme() for scheme in named.schemes("laplacian")}
LAPLACIANS["corrected-distance"] = CorrectedVector(base="distance")
LAGGED = {base: CorrectedVector(base=base, correction="lagged") for base in ("original", "distance")}
NEEDS = tuple(dict.fromkeys(field for model in LAPLACIANS.values() for field in getattr(model, "needs", ())))
FIELDS = (*SYSTEM_FIELDS, SURFACE_SHARE, SOURCE, *WALL_FIELDS, *NEEDS)
FIELDS = tuple(dict.fromkeys(FIELDS))

pytestmark = pytest.mark.usefixtures("runtime")
schemes = pytest.mark.parametrize("laplacian", LAPLACIANS.values(), ids=LAPLACIANS)
lagged = pytest.mark.parametrize("laplacian", LAGGED.values(), ids=LAGGED)
symmetric = [pytest.param(m, id=k) for k, m in LAPLACIANS.items() if m.symmetric]
dimensions = pytest.mark.parametrize("d", [2, 3])


def arrangement(d, disturbance, reach=3.1, **rows):
    cells = 12 if d == 2 else 8
    lattice, particles, pairs = table(
        block(d, cells, disturbance=disturbance), fields=FIELDS, reach=reach, skin=0.05, **rows
    )
    core = inside(particles.numpy("position"), cells, reach=reach, disturbance=disturbance)
    assert core.any()
    return lattice, particles, pairs, core


def polynomials(x):
    """Yield (degree, values, Laplacian) of polynomials, which a symmetric lattice gives exactly."""
    yield 1, 3.0 + 2.0 * x[:, 0] - x[:, 1], np.zeros(len(x))
    yield 2, 4.0 * x[:, 0] ** 2 - x[:, 1] ** 2 + 5.0 * x[:, 0] * x[:, 1], np.full(len(x), 6.0)
    yield 3, x[:, 0] ** 3 + x[:, 0] * x[:, 1] ** 2, 8.0 * x[:, 0]
    yield 2, x[:, -1] ** 2, np.full(len(x), 2.0)


def matrix(particles, system):
    """Return the pressure matrix, shape (n, n), and the right side."""
    return system.sparse(particles).toarray(), particles.numpy("rhs")


def of_velocity(laplacian, lattice, particles, pairs, phi):
    """Return the Laplacian of phi as viscosity with nu = 1 has it."""
    velocity = np.zeros((particles.count, lattice.dimension))
    velocity[:, 0], velocity[:, -1] = phi, -2.0 * phi
    particles.set("kinematic_viscosity", np.ones(particles.count))
    particles.set("slip_velocity", velocity)
    particles.set("acceleration", np.ones((particles.count, lattice.dimension)))
    Explicit(laplacian=laplacian)(lattice, particles, pairs, 0.1)
    found = particles.numpy("acceleration") - 1.0
    assert found[:, -1] == pytest.approx(-2.0 * found[:, 0], rel=1e-9, abs=1e-9 * (1 + np.abs(found).max()))
    return found[:, 0]


def formula(laplacian, lattice, x, over, theta):
    """Return c_ij (the scale included) and the tie to the air, from plain NumPy."""
    d, l0, n = lattice.dimension, lattice.spacing, len(x)
    radius = laplacian.re * l0
    r = offsets(x)
    w = weights(r, laplacian.weight, radius) * over[None, :]
    rr = np.maximum((r**2).sum(axis=-1), 1e-30)
    n0, lambda_ = lattice.n0(laplacian.weight, laplacian.re), lattice.lambda_(laplacian.weight, laplacian.re)
    tie = np.zeros(n)
    key = laplacian.key
    if key == "higher-order":
        axis = np.arange(-4, 5)
        near = np.linalg.norm(np.stack(np.meshgrid(*[axis] * d)).reshape(d, -1), axis=0)
        near = near[(near > 0) & (near < laplacian.re)]
        c = np.where(w > 0, radius / rr**1.5, 0.0) * 2 * d / (laplacian.re / near).sum()
    elif key in ("second-order", "least-squares"):
        v = w / rr if key == "second-order" else w
        mixed = [(0, 1)] if d == 2 else [(0, 1), (1, 2), (2, 0)]
        columns = [*(r[..., k] for k in range(d)), *(r[..., k] ** 2 for k in range(d))]
        q = np.stack([*columns, *(r[..., k] * r[..., m] for k, m in mixed)], axis=-1)
        moments = np.einsum("ij,ijk,ijl->ikl", v, q, q)
        rows = np.linalg.pinv(moments, hermitian=True, rcond=1e-12)[:, d : 2 * d].sum(axis=1)
        c = 2 * v * np.einsum("ijk,ik->ij", q, rows)
    else:
        square = lambda_ if key == "original" or getattr(laplacian, "base", "") == "original" else rr
        c = 2 * d / n0 * w / square
        if key in ("corrected-vector", "dummy-neighbour"):
            correct = np.linalg.inv(d / n0 * np.einsum("ij,ijk,ijl->ikl", w / rr, r, r))
            lean = np.einsum("ij,ijk->ik", c, r)
            if key == "dummy-neighbour":
                size = n0 / (2 * d) * np.linalg.norm(lean, axis=1)
                # W(r)/r = |sum W r/r^2| for W = re/r - 1.
                distance = (np.sqrt(1 + 4 * size * radius) - 1) / (2 * size)
                tie = theta * 2 * d / n0 * size / distance
                lean *= (1 - theta)[:, None]
            c = c - d / n0 * w / rr * np.einsum("ik,ikl,ijl->ij", lean, correct, r)
    return c, tie


@schemes
@dimensions
def test_on_the_regular_arrangement(laplacian, d):
    """As viscosity, nu lap(u), and as matrix, sum_j c_ij/rho (P_i - P_j) = -lap(P)/rho."""
    lattice, particles, pairs, core = arrangement(d, 0.0)
    particles.set("row_state", np.full(particles.count, UNKNOWN))
    system = LinearSystem()
    system.assemble(laplacian, lattice, particles, pairs)
    dense, rhs = matrix(particles, system)
    assert not rhs.any()
    assert system.symmetric == laplacian.symmetric
    for _, phi, expected in polynomials(particles.numpy("position")):
        found = of_velocity(laplacian, lattice, particles, pairs, phi)
        assert found[core] == pytest.approx(expected[core], rel=1e-9, abs=1e-9)
        assert (dense @ phi)[core] == pytest.approx(-expected[core] / 1000.0, rel=1e-9, abs=1e-12)


@schemes
@dimensions
def test_exact_up_to_its_order_on_a_disturbed_arrangement(laplacian, d):
    """And no further: an error of the second degree is there unless it is claimed away."""
    lattice, particles, pairs, core = arrangement(d, 0.3)
    x = particles.numpy("position")
    assert of_velocity(laplacian, lattice, particles, pairs, np.full(len(x), 7.0)) == pytest.approx(0.0, abs=1e-9)
    for degree, phi, expected in polynomials(x):
        found = of_velocity(laplacian, lattice, particles, pairs, phi)[core]
        if degree <= laplacian.order:
            assert found == pytest.approx(expected[core], rel=1e-8, abs=1e-8)
        else:
            assert np.abs(found - expected[core]).max() > 1e-3


@pytest.mark.parametrize("key", ["second-order", "least-squares"])
@dimensions
def test_error_of_second_order_models_falls_with_the_spacing(key, d):
    """First order for a smooth function on a disturbed lattice; the original model's error grows (as 1/l0)."""
    errors = {key: [], "original": []}
    for spacing in (0.1, 0.05):
        cells = 12 if d == 2 else 8
        lattice, particles, pairs = table(block(d, cells, spacing, 0.3), spacing, fields=FIELDS, reach=3.1, skin=0.05)
        x = particles.numpy("position")
        core = inside(x, cells, spacing, 3.1, 0.3)
        phi = np.sin(2 * x[:, 0] + x[:, 1])
        for name, found in errors.items():
            of = of_velocity(LAPLACIANS[name], lattice, particles, pairs, phi)
            found.append(np.sqrt(np.mean((of + 5 * phi)[core] ** 2)))
    assert errors[key][1] < 0.7 * errors[key][0]
    assert errors["original"][1] > 1.5 * errors["original"][0]
    assert errors[key][0] < 0.2 * errors["original"][0]


@schemes
@dimensions
def test_entries_against_the_formula(laplacian, d):
    """Rows of two densities, and every state, against NumPy."""
    rng = np.random.default_rng(4)
    n = 12**2 if d == 2 else 8**3
    density = rng.choice([1000.0, 1.0], n)
    # What is absent is a dummy, so that a model can know it by its kind.
    kind = rng.choice([DUMMY, *[FLUID] * 8, WALL], n)
    lattice, particles, pairs, _ = arrangement(
        d, 0.3, kind=kind, density=density, source=rng.normal(size=n),
        pressure=rng.normal(size=n), wall_acceleration=rng.normal(size=(n, d)), surface_share=rng.uniform(size=n),
        surface_diagonal=np.where(rng.uniform(size=n) < 0.3, 0.5, 0.0), surface_value=rng.normal(size=n),
    )  # fmt: skip
    kind = particles.numpy("kind")
    state = np.where(rng.uniform(size=n) < 0.15, KNOWN, UNKNOWN)
    state = np.select([kind == DUMMY, kind == WALL], [ABSENT, FLUX], state)
    particles.set("row_state", state)
    system = LinearSystem()
    system.assemble(laplacian, lattice, particles, pairs, over=FLUID | WALL)
    dense, rhs = matrix(particles, system)

    density = particles.numpy("density")
    x, theta = particles.numpy("position"), particles.numpy("surface_share")
    c, tie = formula(laplacian, lattice, x, state != ABSENT, theta)
    # A solid row without an equation is an image of the row that looks at it.
    c *= np.where(state == FLUX, 1 / density[:, None], 2 / (density[:, None] + density[None, :]))
    unknown = state == UNKNOWN
    if "fit_degree" in [field.name for field in getattr(laplacian, "needs", ())]:
        unknown &= particles.numpy("fit_degree") == 2
        assert unknown.sum() > n / 4
    draw = particles.numpy("surface_diagonal")
    seen = np.where((state == UNKNOWN) | (state == KNOWN), 1.0, 0.0)
    expected = np.where((state == UNKNOWN)[None, :], -c, 0.0) + np.diag(c @ seen + draw + tie / density)
    rows = np.flatnonzero(unknown)
    assert dense[rows] == pytest.approx(expected[rows], rel=1e-7, abs=1e-8 * np.abs(c[rows]).max())
    r = offsets(x)
    flux = (c * np.einsum("ijk,jk->ij", r, particles.numpy("wall_acceleration")))[:, state == FLUX].sum(
        axis=1
    ) * density
    given = c[:, state == KNOWN] @ particles.numpy("pressure")[state == KNOWN]
    outside = (draw + tie / density) * particles.numpy("surface_value")
    right = -particles.numpy("source") + outside + given + flux
    assert rhs[rows] == pytest.approx(right[rows], rel=1e-7, abs=1e-8 * np.abs(right).max())
    w = weights(r, laplacian.weight, laplacian.re * 0.1)
    known = ((w > 0)[:, state == KNOWN]).any(axis=1)
    own = draw + tie / density
    share = np.where(known, 100, np.maximum(100 * own / np.maximum(np.diag(expected), own + 1e-30), own > 0))
    assert np.abs(particles.numpy("grounded") - share)[rows].max() <= 1
    assert np.array_equal(particles.numpy("grounded")[rows] > 0, (known | (draw + tie > 0))[rows])


@pytest.mark.parametrize("laplacian", symmetric)
@dimensions
def test_symmetric_models_give_an_m_matrix(laplacian, d):
    """Symmetric, nothing positive off the diagonal, rows that sum to what the free surface adds: no overshoot."""
    lattice, particles, pairs, _ = arrangement(d, 0.3, surface_diagonal=np.full(12**2 if d == 2 else 8**3, 0.1))
    particles.set("row_state", np.full(particles.count, UNKNOWN))
    system = LinearSystem()
    system.assemble(laplacian, lattice, particles, pairs)
    dense, _ = matrix(particles, system)
    assert np.abs(dense - dense.T).max() < 1e-12 * dense.max()
    assert (dense - np.diag(np.diag(dense))).max() <= 0.0
    assert dense.sum(axis=1) == pytest.approx(0.1, abs=1e-9 * dense.max())


def test_the_others_are_not_symmetric():
    lattice, particles, pairs, _ = arrangement(2, 0.3)
    particles.set("row_state", np.full(particles.count, UNKNOWN))
    system = LinearSystem()
    for key, laplacian in LAPLACIANS.items():
        system.assemble(laplacian, lattice, particles, pairs)
        dense, _ = matrix(particles, system)
        assert (np.abs(dense - dense.T).max() > 1e-3 * dense.max()) == (not laplacian.symmetric), key


@lagged
@dimensions
def test_the_lagged_correction(laplacian, d):
    """With the right gradient of the step before, linear pressures leave nothing; it fades out at the surface."""
    lattice, particles, pairs, core = arrangement(d, 0.3)
    n = particles.count
    particles.set("row_state", np.full(n, UNKNOWN))
    slope = np.array([3.0, -2.0, 0.5][:d])
    particles.set("pressure_gradient", np.broadcast_to(slope, (n, d)))
    system = LinearSystem()
    system.assemble(laplacian, lattice, particles, pairs)
    assert laplacian.symmetric
    assert system.symmetric
    dense, rhs = matrix(particles, system)
    assert np.abs(dense - dense.T).max() < 1e-12 * dense.max()
    phi = particles.numpy("position") @ slope
    size = np.abs(dense).max() * np.abs(phi).max()
    assert dense @ phi - rhs == pytest.approx(0.0, abs=1e-12 * size)
    assert np.abs((dense @ phi)[core]).max() > 1e-3 * size, "which without it is not so"
    plain = LAPLACIANS[laplacian.base]
    system.assemble(plain, lattice, particles, pairs)
    # Another kernel, which adds up its vectors in another order.
    assert matrix(particles, system)[0] == pytest.approx(dense, rel=1e-14, abs=1e-14 * np.abs(dense).max())
    particles.set("surface_share", np.ones(n))
    system.assemble(laplacian, lattice, particles, pairs)
    assert not particles.numpy("rhs").any()


def test_a_lagged_correction_is_refused_by_viscosity():
    with pytest.raises(CaseError, match="'lagged' corrects the pressure only: choose correction = 'full'"):
        Explicit(laplacian=LAGGED["original"])


@pytest.mark.parametrize(
    ("d", "re", "three", "two"),
    [(2, 2.1, 2.126, 1.417), (2, 3.1, 1.857, 1.238), (3, 2.1, None, 1.073), (3, 4.1, None, 0.973)],
)  # fmt: skip
def test_forms_of_the_higher_order_model(d, re, three, two):
    """Factor on the Laplacian of |x|^2 on the regular arrangement, as summed independently of this code."""
    cells = 2 * int(np.ceil(re)) + 1
    lattice, particles, pairs = table(block(d, cells), fields=FIELDS, reach=re, skin=0.05)
    x = particles.numpy("position")
    middle = int(np.argmin(np.linalg.norm(x, axis=1)))
    factors = {}
    for form in ("published", "consistent", "calibrated"):
        found = of_velocity(HigherOrder(form=form, re=re), lattice, particles, pairs, (x**2).sum(axis=1))
        factors[form] = found[middle] / (2 * d)
    assert factors["published"] == pytest.approx(three or two, abs=1e-3)
    assert factors["consistent"] == pytest.approx(two, abs=1e-3)
    assert factors["calibrated"] == pytest.approx(1.0, rel=1e-12)


def test_the_higher_order_model_belongs_to_one_weight():
    with pytest.raises(CaseError, match="derived from the weight 'inverse', not 'quadratic'"):
        HigherOrder(weight=Quadratic())


@dimensions
def test_dummy_neighbour_of_a_flat_surface(d):
    """It lies straight above the row, at the distance where it evens out the sum, and ties the row to the air."""
    lattice, particles, pairs, _ = arrangement(d, 0.0, surface_share=np.ones(12**2 if d == 2 else 8**3))
    model = DummyNeighbour()
    model.prepare(lattice, particles, pairs)
    x = particles.numpy("position")
    middle = np.abs(x[:, :-1]).max(axis=1) < 0.051
    top = middle & (x[:, -1] > x[:, -1].max() - 0.01)
    lack = particles.numpy("lack")[top]
    assert lack[:, :-1] == pytest.approx(0.0, abs=1e-9)
    assert np.all(lack[:, -1] < 0)
    size = np.abs(lack[:, -1]) * lattice.n0(model.weight, 2.1) / d
    distance = size / particles.numpy("outside_weight")[top]
    assert np.all((distance > 0.05) & (distance < 0.15)), "about a spacing outside"
    assert (0.21 / distance - 1) / distance == pytest.approx(size, rel=1e-6)
    deep = middle & (np.abs(x[:, -1]) < 0.2)
    assert particles.numpy("outside_weight")[deep] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("laplacian", symmetric)
def test_viscosity_conserves_momentum(laplacian):
    """Between fluid rows, also of different viscosities and densities."""
    rng = np.random.default_rng(4)
    nu, rho = rng.choice([1e-6, 0.5], 144), rng.choice([1.0, 1000.0], 144)
    lattice, particles, pairs, _ = arrangement(2, 0.3, kinematic_viscosity=nu, density=rho)
    velocity = rng.normal(size=(144, 2))
    particles.set("slip_velocity", velocity)
    viscosity = Explicit(laplacian=laplacian)
    viscosity(lattice, particles, pairs, 0.1)
    assert "momentum" in viscosity.conserves
    found = particles.numpy("acceleration") * particles.numpy("density")[:, None]
    assert np.abs(found.sum(axis=0)).max() < 1e-12 * np.abs(found).sum()
    assert np.abs(found).max() > 1.0
    assert (found * velocity).sum() < 0, "viscosity takes energy"


def test_rows_without_neighbours_enough_take_the_original_form():
    """A chain: no second derivative across it is known, and the sum along it is that of the original model."""
    position = np.stack([np.arange(9) * 0.1, np.zeros(9)], axis=1)
    lattice, particles, pairs = table(position, fields=FIELDS, reach=3.1, skin=0.05)
    phi = position[:, 0] ** 2
    found = of_velocity(SecondOrder(), lattice, particles, pairs, phi)
    original = of_velocity(LAPLACIANS["original"].model_copy(update={"re": 3.1}), lattice, particles, pairs, phi)
    assert found == pytest.approx(original, rel=1e-9)


def test_stable_time_step_of_viscosity():
    lattice, *_ = arrangement(2, 0.0)
    assert Explicit().max_dt(lattice, 0.5) == pytest.approx(0.01 / (4 * 2 * 0.5))
    assert Explicit().max_dt(lattice, 0.0) == np.inf
