"""Gradient models: exact on the polynomials that they claim, conservative where they claim it, and their formulas."""

import numpy as np
import pytest
from scipy.optimize import brentq

from arrangements import block, cloud, inside, offsets, table, weights
from spume import kernels, named
from spume.pairs import PairView
from spume.particles import FLUID, WALL
from spume.schemes import discover
from spume.schemes.correction import CORRECTION
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.gradient.cmps import Conservative
from spume.schemes.gradient.stabilised import Stabilised

discover()
GRADIENTS = {scheme.key: scheme() for scheme in named.schemes("gradient")}
GRADIENTS["cmps-consistent"] = Conservative(form="consistent")
FIELDS = [CORRECTION, SURFACE_SHARE, *(f for g in GRADIENTS.values() for f in getattr(g, "needs", ()))]
SLOPES = {2: np.array([3.0, -2.0]), 3: np.array([3.0, -2.0, 0.5])}

pytestmark = pytest.mark.usefixtures("runtime")
schemes = pytest.mark.parametrize("gradient", GRADIENTS.values(), ids=GRADIENTS)
dimensions = pytest.mark.parametrize("d", [2, 3])


def arrangement(d, disturbance, **rows):
    return cloud(d, disturbance, FIELDS, **rows)


def gradient_of(gradient, lattice, particles, pairs, phi, **more):
    particles.set("scalar", phi)
    particles.set("vector", np.full((particles.count, particles.dimension), np.nan))
    gradient(lattice, particles, pairs, phi="scalar", out="vector", **more)
    return particles.numpy("vector")


def quadratic(x):
    """Return a polynomial of second degree and its gradient."""
    d = x.shape[1]
    curvature = np.array([[2.0, -3.0, 1.0], [-3.0, 1.5, 0.5], [1.0, 0.5, -1.0]])[:d, :d]
    return 5.0 + x @ SLOPES[d] + 0.5 * np.einsum("ij,jk,ik->i", x, curvature, x), SLOPES[d] + x @ curvature


@schemes
@dimensions
def test_claims(gradient, d):
    """Order 0: nothing for constants, 1: exact for linear fields, 2: for quadratic ones; in every corner of a block."""
    lattice, particles, pairs, _ = arrangement(d, 0.3)
    found = gradient_of(gradient, lattice, particles, pairs, np.full(particles.count, 7.0))
    if gradient.order < 0:
        assert np.abs(found).max() > 1.0
    else:
        assert found == pytest.approx(0.0, abs=1e-10)
    if gradient.order >= 1:
        phi = 5.0 + particles.numpy("position") @ SLOPES[d]
        found = gradient_of(gradient, lattice, particles, pairs, phi)
        assert found == pytest.approx(np.broadcast_to(SLOPES[d], found.shape), rel=1e-10)
    if gradient.order >= 2:
        phi, expected = quadratic(particles.numpy("position"))
        found = gradient_of(gradient, lattice, particles, pairs, phi)
        # Some rows of the corners have too few neighbours for second derivatives, and stay at first order.
        fitted = particles.numpy("fit_degree") == 2
        assert fitted.mean() > 0.98
        assert found[fitted] == pytest.approx(expected[fitted], rel=1e-9, abs=1e-9)


@schemes
@dimensions
def test_polynomials_on_the_regular_arrangement(gradient, d):
    """Linear fields, and by symmetry quadratic ones."""
    if gradient == GRADIENTS["cmps"]:
        pytest.skip("loses linear fields: the test below")
    lattice, particles, pairs, core = arrangement(d, 0.0)
    x = particles.numpy("position")
    found = gradient_of(gradient, lattice, particles, pairs, 5.0 + x @ SLOPES[d])[core]
    assert found == pytest.approx(np.broadcast_to(SLOPES[d], found.shape), rel=1e-10)
    if "minimum" not in gradient.key:
        phi, expected = quadratic(x)
        assert gradient_of(gradient, lattice, particles, pairs, phi)[core] == pytest.approx(expected[core], abs=1e-9)


@dimensions
def test_the_published_form_of_cmps_loses_a_linear_field(d):
    """P - Pmin is then the same everywhere, and a central, equal and opposite force per pair sums to nothing."""
    cells = 11
    lattice, particles, pairs = table(block(d, cells), fields=FIELDS)
    x = particles.numpy("position")
    deep = inside(x, cells, reach=4.1)  # neighbours' minima need full surroundings as well
    assert deep.any()
    found = gradient_of(GRADIENTS["cmps"], lattice, particles, pairs, 5.0 + x @ SLOPES[d])
    assert found[deep] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("key", ["corrected", "completed", "second-order"])
@dimensions
def test_corrected_models_are_exact_inside_a_disturbed_fluid(key, d):
    lattice, particles, pairs, core = arrangement(d, 0.3)
    phi = 5.0 + particles.numpy("position") @ SLOPES[d]
    found = gradient_of(GRADIENTS[key], lattice, particles, pairs, phi)[core]
    assert found == pytest.approx(np.broadcast_to(SLOPES[d], found.shape), rel=1e-9)


@pytest.mark.parametrize("key", ["original", "minimum", "cmps", "sum", "stabilised", "corrected-minimum"])
@dimensions
def test_other_models_are_not(key, d):
    """Otherwise the test above would show nothing."""
    lattice, particles, pairs, core = arrangement(d, 0.3)
    phi = 5.0 + particles.numpy("position") @ SLOPES[d]
    found = gradient_of(GRADIENTS[key], lattice, particles, pairs, phi)[core]
    assert np.abs(found - SLOPES[d]).max() > 0.1


@dimensions
def test_a_dummy_neighbour_leaves_the_square_of_the_disorder(d):
    """The error of the original model falls with the disorder, that with a dummy neighbour nearly with its square."""
    errors = {}
    for disturbance in (0.04, 0.01):
        lattice, particles, pairs, core = arrangement(d, disturbance)
        phi = 5.0 + particles.numpy("position") @ SLOPES[d]
        for key in ("original", "dummy-neighbour"):
            found = gradient_of(GRADIENTS[key], lattice, particles, pairs, phi)[core]
            errors.setdefault(key, []).append(np.abs(found - SLOPES[d]).max())
    power = {key: np.log(coarse / fine) / np.log(4.0) for key, (coarse, fine) in errors.items()}
    assert power["original"] == pytest.approx(1.0, abs=0.05)
    # Not quite the square: the dummy draws nearer as the disorder grows.
    assert 1.7 < power["dummy-neighbour"] < 2.0


@pytest.mark.parametrize(
    ("key", "rate"), [("original", 0), ("dummy-neighbour", 0), ("corrected", 1), ("second-order", 2)]
)
@dimensions
def test_convergence_on_a_disturbed_lattice(key, rate, d):
    """A wave at two spacings, each with the same relative disturbance."""
    errors = []
    for cells, l0 in ((18, 0.06), (36, 0.03)) if d == 2 else ((9, 0.12), (18, 0.06)):
        lattice, particles, pairs = table(block(d, cells, l0, 0.3), l0, fields=FIELDS)
        x = particles.numpy("position")
        core = np.all(np.abs(x) < 0.24, axis=1)
        wave = np.array([0.9, 0.6, 0.45])[:d]
        found = gradient_of(GRADIENTS[key], lattice, particles, pairs, np.sin(x @ wave + 0.4))
        expected = np.cos(x @ wave + 0.4)[:, None] * wave
        errors.append(np.sqrt(np.mean((found - expected)[core] ** 2)))
    assert rate - 0.3 < np.log2(errors[0] / errors[1]) < rate + 0.6


@schemes
@dimensions
def test_momentum(gradient, d):
    """Forces of pairs cancel, and those along the line of the pair make no torque; other models do neither."""
    lattice, particles, pairs, _ = arrangement(d, 0.3)
    x, phi = particles.numpy("position"), np.random.default_rng(3).normal(size=particles.count)
    found = gradient_of(gradient, lattice, particles, pairs, phi)
    size = np.abs(found).sum()
    net = np.abs(found.sum(axis=0)).max() / size
    torque = np.abs(np.einsum("ij,ik->jk", x, found) - np.einsum("ij,ik->kj", x, found)).max() / size
    assert (net < 1e-12) == ("momentum" in gradient.conserves)
    assert (torque < 1e-12) == ("angular momentum" in gradient.conserves)


def least_of(phi, w):
    return np.where((w > 0) | np.eye(len(phi), dtype=bool), phi[None, :], np.inf).min(axis=1)


def by_formula(key, phi, r, w, d, n0, re=0.21):
    """Return a model's gradient by its formula, from all pairs at once."""
    rr = np.maximum((r**2).sum(axis=-1), 1e-30)
    share = d / n0 * w / rr
    least = least_of(phi, w)
    own, other = phi[:, None], phi[None, :]
    pair = {
        "minimum": other - least[:, None], "corrected-minimum": other - least[:, None], "sum": own + other,
        "cmps": own + other - least[:, None] - least[None, :], "cmps-consistent": own + other - 2 * phi.min(),
    }.get(key, other - own)  # fmt: skip
    total = ((share * pair)[..., None] * r).sum(axis=1)
    moment = np.einsum("ij,ijk,ijl->ikl", share, r, r)
    if key in ("corrected", "corrected-minimum"):
        return np.linalg.solve(moment, total[..., None])[..., 0]
    if key in ("completed", "imaged"):
        lift = np.maximum({"completed": 0.3, "imaged": 0.45}[key] - np.linalg.eigvalsh(moment)[:, 0], 0.0)
        return np.linalg.solve(moment + lift[:, None, None] * np.eye(d), total[..., None])[..., 0]
    if key == "second-order":
        s, l0 = np.sqrt(rr), 0.1
        squares = [r[..., k] ** 2 for k in range(d)]
        mixed = [r[..., k] * r[..., m] for k in range(d) for m in range(k)]
        p = np.stack([*np.moveaxis(r, -1, 0), *(q / l0 for q in (*squares, *mixed))], axis=-1) / s[..., None]
        normal = np.einsum("ij,ija,ijb->iab", w / n0, p, p)
        right = np.einsum("ij,ija->ia", w / n0 * (other - own) / s, p)
        return np.linalg.solve(normal, right[..., None])[:, :d, 0]
    if key == "dummy-neighbour":
        uneven = (w / rr)[..., None] * r
        result = np.zeros_like(total)
        for i, a in enumerate(uneven.sum(axis=1)):
            size = np.linalg.norm(a)
            distance = brentq(lambda s, size=size: (re / s - 1) / s - size, 1e-6, re)
            dummy = -a / size * distance
            weight = d / n0 * (re / distance - 1) / distance**2
            extrapolated = dummy @ total[i]
            matrix = moment[i] + weight * np.outer(dummy, dummy)
            result[i] = np.linalg.solve(matrix, total[i] + weight * extrapolated * dummy)
        return result
    return total


@schemes
@dimensions
def test_formulas(gradient, d):
    """Each model against its sum, on a disturbed arrangement with random values."""
    lattice, particles, pairs, core = arrangement(d, 0.3)
    phi = np.random.default_rng(3).normal(size=particles.count)
    r = offsets(particles.numpy("position"))
    key = next(key for key, scheme in GRADIENTS.items() if scheme == gradient)
    expected = by_formula(key, phi, r, weights(r, gradient.weight, 0.21), d, lattice.n0(gradient.weight, 2.1))
    found = gradient_of(gradient, lattice, particles, pairs, phi)
    assert found[core] == pytest.approx(expected[core], rel=1e-8, abs=1e-8)


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

    def continued(a, b, r, gx, gy):
        value = b.value
        if b.kind != 1:
            value = a.value + gx * r[0] + gy * r[1]
        return value

    view = PairView(kernels.func(continued), ("value", "kind"), arguments=tuple(SLOPES[2].tolist()))
    particles.set("scalar", garbage)
    gradient(lattice, particles, pairs, phi="scalar", out="vector", view=view)
    found = particles.numpy("vector")[core & ~solid]
    if gradient == GRADIENTS["cmps"]:
        assert np.abs(found).max() < 10.0, "the garbage behind the view is not read"
    else:
        assert found == pytest.approx(np.broadcast_to(SLOPES[2], found.shape), rel=1e-9)
    gradient(lattice, particles, pairs, phi="scalar", out="vector", over=FLUID)
    assert np.abs(particles.numpy("vector")[~solid]).max() < 1e3, "a row that carries nothing is not read"


def pair_of(distance, approach, density=(1000.0, 1000.0)):
    """Two rows on a slanted line, that approach each other with a speed [m/s] and drift sideways together."""
    axis = np.array([0.6, 0.8])
    velocity = np.array([[0.3, 0.1]]) + np.outer([0.5, -0.5], approach * axis)
    return table([[0.0, 0.0], distance * axis], fields=FIELDS, velocity=velocity, density=np.array(density))


def moved_by(lattice, particles, pairs, gradient, dt, moved):
    """Return the positions [m] at the end of the step, by id."""
    g = gradient_of(gradient, lattice, particles, pairs, np.zeros(particles.count), dt=dt, moved=moved)
    x, u = particles.numpy("position"), particles.numpy("velocity")
    end = (0.0 if moved else dt * u) + x - dt**2 / particles.numpy("density")[:, None] * g
    return end[np.argsort(particles.numpy("id"))], g


@pytest.mark.parametrize("moved", [True, False], ids=["at-r*", "at-rk"])
@pytest.mark.parametrize("density", [(1000.0, 1000.0), (1000.0, 1.0)])
def test_stabilisation_moves_a_pair_back_to_its_distance(moved, density):
    """In one step, and the lighter more; at r* it has penetrated, at r^k it is about to."""
    gradient, dt = Stabilised(form="consistent", alpha=0.8), 0.01
    start, end = (0.06, 0.08) if moved else (0.1, 0.08)
    handles = pair_of(start, 4.0, density)
    x, g = moved_by(*handles, gradient, dt, moved)
    assert np.linalg.norm(x[1] - x[0]) == pytest.approx(end, rel=1e-9)
    assert np.abs(g.sum(axis=0)).max() < 1e-9 * np.abs(g).max()
    # As printed: only the share W/n0 of the way, W at the distance at which it is summed.
    lattice, weight = handles[0], gradient.weight
    x, g = moved_by(*handles, Stabilised(form="published", alpha=0.8), dt, moved)
    without = 0.06
    share = float(weight.values(start, 0.21)) / lattice.n0(weight, 2.1)
    assert np.linalg.norm(x[1] - x[0]) == pytest.approx(without + share * (end - without), rel=1e-9)


def test_stabilisation_is_silent_beyond_its_distance():
    gradient = Stabilised(form="consistent", alpha=0.8)
    for distance, approach, moved, dt in ((0.081, 4.0, True, 0.01), (0.1, 1.9, False, 0.01), (0.05, 4.0, True, 0.0)):
        _, g = moved_by(*pair_of(distance, approach), gradient, dt, moved)
        assert not g.any()
    _, g = moved_by(*pair_of(0.05, 0.0), gradient, 0.01, True)
    assert g.any()


def test_stabilisation_takes_the_direction_before_the_motion():
    """A pair that turned within the step is pushed along its old direction."""
    position, velocity = [[0.0, 0.0], [0.05, 0.03]], [[0.0, 0.0], [0.0, 3.0]]
    handles = table(position, fields=FIELDS, velocity=velocity)
    x, _ = moved_by(*handles, Stabilised(form="consistent", alpha=0.8), 0.01, True)
    assert np.linalg.norm(x[1] - x[0]) == pytest.approx(0.08)
    assert x[1] - x[0] == pytest.approx([np.sqrt(0.08**2 - 0.03**2), 0.03])


def test_a_wall_does_not_yield():
    handles = table([[0.0, 0.0], [0.06, 0.0]], fields=FIELDS, kind=[FLUID, WALL])
    gradient_of(Stabilised(form="consistent", alpha=0.8), *handles, np.zeros(2), dt=0.01)
    particles = handles[1]
    pushed = particles.numpy("vector")[particles.numpy("kind") == FLUID][0]
    assert -(0.01**2) / 1000.0 * pushed == pytest.approx([-0.02, 0.0])
