"""A flat surface that is no longer the lattice: what the schemes with images claim of it."""

import numpy as np
import pytest

from arrangements import table
from spume.build import build
from spume.case import load
from spume.lattice import Lattice
from spume.particles import FLUID, WALL
from spume.pressure.matrix import SYSTEM_FIELDS, UNKNOWN, LinearSystem
from spume.schemes.correction import CORRECTION
from spume.schemes.divergence.bounded import Bounded
from spume.schemes.divergence.original import Original as OriginalDivergence
from spume.schemes.free_surface.imaged import Imaged as ImagedSurface
from spume.schemes.gradient.completed import Completed
from spume.schemes.gradient.imaged import Imaged as ImagedGradient
from spume.schemes.laplacian.distance import Distance
from spume.schemes.number_density.base import Original as NumberDensity
from spume.schemes.shifting.fickian_along_surface import FickianAlongSurface
from spume.schemes.source.base import DIVERGENCE, SOURCE
from spume.schemes.source.divergence_density import DivergenceDensity
from spume.schemes.surface_images import crowding_of_images, density_of_images, surface_images
from spume.schemes.velocity_gradient import VELOCITY_GRADIENT, keep_volume
from spume.schemes.weight.inverse import Inverse
from spume.schemes.weight.quadratic import Quadratic

L0 = 0.1
NEEDS = (part.needs for part in (ImagedSurface, ImagedGradient, Bounded, FickianAlongSurface, DivergenceDensity))
FIELDS = dict.fromkeys(
    (*SYSTEM_FIELDS, CORRECTION, VELOCITY_GRADIENT, SOURCE, DIVERGENCE, *(f for needs in NEEDS for f in needs))
)

pytestmark = pytest.mark.usefixtures("runtime")
dimensions = pytest.mark.parametrize("d", [2, 3])


def layer(d, along=1.0, across=1.0, **rows):
    """Return the table of a layer whose top centres lie at zero, periodic along it, and which rows are the top.

    Args:
        along, across: distance of the rows as multiples of l0.
    """
    n = 8
    axes = [(np.arange(n) + 0.5) * along * L0] * (d - 1) + [-np.arange(7) * across * L0]
    x = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, d)
    period = n * along * L0
    region = ([0.0] * (d - 1) + [-10.0], [period] * (d - 1) + [10.0])
    given = {name: values(x) for name, values in rows.items()}
    handles = table(x, spacing=L0, fields=FIELDS, skin=0.0, region=region, periodic=[True] * (d - 1) + [False], **given)
    depth = -handles[1].numpy("position")[:, -1]
    return handles, depth, depth < 0.5 * across * L0


def weight_of(depth, distance=0.5 * L0):
    """Return a pressure that vanishes at a distance above the top centres."""
    return 9810.0 * (depth + distance)


def distance_of_surface(particles, top):
    """Return the distance that the schemes give the surface of a layer, whose top rows are all alike."""
    found = particles.numpy("surface_distance")[top]
    assert np.ptp(found) < 1e-12
    return found[0]


ARRANGEMENTS = pytest.mark.parametrize(
    ("along", "across"), [(1.0, 1.0), (1.2, 0.8), (0.85, 1.1)], ids=["lattice", "stretched", "crowded"]
)


@dimensions
@ARRANGEMENTS
def test_gradient_of_a_pressure_that_vanishes_on_the_surface(d, along, across):
    (lattice, particles, pairs), depth, top = layer(d, along, across)
    particles.set("surface_share", top.astype(float))
    surface_images(ImagedGradient(), lattice, particles, pairs)
    particles.set("scalar", weight_of(depth, distance_of_surface(particles, top)))
    exact = np.zeros((int(top.sum()), d))
    exact[:, -1] = -9810.0
    ImagedGradient(floor=0.5)(lattice, particles, pairs, phi="scalar", out="vector")  # the stretched layer has 0.59
    assert particles.numpy("vector")[top] == pytest.approx(exact, abs=1e-6)
    if along > 1.0:
        Completed()(lattice, particles, pairs, phi="scalar", out="vector")
        assert np.abs(particles.numpy("vector")[top] - exact).max() > 0.01 * 9810.0, "the lattice's images are not"


@dimensions
@ARRANGEMENTS
def test_matrix_of_a_pressure_that_vanishes_on_the_surface(d, along, across):
    """Laplacian and images of a surface row cancel: 2 s . g + 2 s . g_image, both slopes the same."""
    (lattice, particles, pairs), depth, top = layer(d, along, across)
    number_density, laplacian, surface = NumberDensity(), Distance(), ImagedSurface(upper=1.0, lower=0.95)
    number_density(lattice, particles, pairs)
    surface(lattice, particles, pairs, number_density)
    particles.set("surface_share", top.astype(float))
    surface_images(surface, lattice, particles, pairs)
    surface.draw(lattice, particles, laplacian, number_density)
    particles.set("row_state", np.full(particles.count, UNKNOWN))
    p = weight_of(depth, distance_of_surface(particles, top))
    linear = LinearSystem()
    linear.assemble(laplacian, lattice, particles, pairs)
    residual = linear.sparse(particles) @ p
    images = particles.numpy("surface_diagonal")
    for i in np.flatnonzero(top)[:5]:
        assert images[i] * p[i] > 1.0
        assert abs(residual[i]) < 1e-11 * images[i] * p[i]
    assert not images[depth > 1.5 * across * L0].any()


@dimensions
def test_surface_is_as_far_as_the_rows_are_apart(d):
    """Stretched along its normal at constant volume: half of the distance of the rows, to second order."""
    errors = []
    for stretch in (1.0, 1.02, 0.98, 1.1, 0.9):
        (lattice, particles, pairs), _, top = layer(d, stretch ** (-1 / (d - 1)), stretch)
        particles.set("surface_share", top.astype(float))
        surface_images(ImagedSurface(), lattice, particles, pairs)
        assert particles.numpy("images")[top][:, :-1] == pytest.approx(0.0, abs=1e-9)
        errors.append(abs(distance_of_surface(particles, top) / (0.5 * L0 * stretch) - 1.0))
    assert errors[0] < 1e-12
    assert max(errors[1:3]) < 2e-3
    assert max(errors[3:]) < 0.05


def test_surface_at_a_wall_that_goes_on_above_the_water():
    """Images lie straight above the water, and at its distance, though the wall's upper rows pull towards it."""
    n = 6
    wet = [(-(i + 0.5) * L0, -(j + 0.5) * L0, FLUID) for i in range(n) for j in range(n)]
    wall = [((i + 0.5) * L0, (j - n + 0.5) * L0, WALL) for i in range(3) for j in range(2 * n)]
    rows = np.array(wet + wall)
    normals = np.where(rows[:, 2:] == WALL, -rows[:, :1] * [[1.0, 0.0]], 0.0)
    lattice, particles, pairs = table(
        rows[:, :2], spacing=L0, fields=FIELDS, skin=0.0, kind=rows[:, 2].astype(int), to_surface=normals
    )
    x, fluid = particles.numpy("position"), particles.numpy("kind") == FLUID
    particles.set("surface_share", (fluid & (x[:, 1] > -L0)).astype(float))
    surface_images(ImagedSurface(), lattice, particles, pairs)
    at_wall = fluid & (x[:, 1] > -L0) & (x[:, 0] > -L0)
    assert at_wall.sum() == 1
    (b,) = particles.numpy("images")[at_wall]
    (s,) = particles.numpy("crowding")[at_wall]
    assert abs(s[0]) > 0.1 * abs(s[1]), "the wall above the water pulls"
    assert abs(b[0]) < 0.02 * abs(b[1])
    assert b[1] == pytest.approx(s[1], rel=0.01)
    assert particles.numpy("surface_distance")[at_wall] == pytest.approx(0.5 * L0, rel=0.02)


@pytest.mark.parametrize("aside", [0.2, 0.4])
def test_the_end_of_a_sheet_along_a_wall_has_images(aside):
    """Its neighbours on the surface lie along the wall, and look at it: beyond the end there is nothing."""
    sheet = [(-(i + 0.5) * L0, (j + 0.5) * L0, FLUID) for i in range(2) for j in range(7)]
    end = (-(0.5 + aside) * L0, 0.5 * L0)
    sheet[0] = (*end, FLUID)
    wall = [((i + 0.5) * L0, (j - 5.5) * L0, WALL) for i in range(3) for j in range(18)]
    rows = np.array(sheet + wall)
    normals = np.where(rows[:, 2:] == WALL, -rows[:, :1] * [[1.0, 0.0]], 0.0)
    lattice, particles, pairs = table(
        rows[:, :2], spacing=L0, fields=FIELDS, skin=0.0, kind=rows[:, 2].astype(int), to_surface=normals
    )
    x, fluid = particles.numpy("position"), particles.numpy("kind") == FLUID
    particles.set("surface_share", fluid.astype(float))
    surface_images(ImagedSurface(), lattice, particles, pairs)
    (row,) = np.flatnonzero(np.abs(x - end).max(axis=1) < 1e-6)
    assert particles.numpy("images")[row] * L0 == pytest.approx([0.0, 0.44], abs=0.01)


@dimensions
@pytest.mark.parametrize("stretch", [1.0, 0.9])
def test_images_complete_the_number_density(d, stretch):
    """Of the row below the surface, whatever the distance of the rows; without them it misses neighbours."""
    number_density = NumberDensity(weight=Quadratic())
    (lattice, particles, pairs), depth, top = layer(d, 1.0, stretch)
    particles.set("surface_share", top.astype(float))
    surface_images(ImagedSurface(), lattice, particles, pairs)
    # The images of a flat surface are as far above it as its rows are below.
    particles.set("surface_distance", np.full(particles.count, 0.5 * stretch * L0))
    number_density(lattice, particles, pairs)
    density_of_images(number_density, lattice, particles, pairs)
    n, more = particles.numpy("number_density"), particles.numpy("images_density")
    second = (depth > 0.5 * stretch * L0) & (depth < 1.5 * stretch * L0)
    middle = (depth > 2.5 * stretch * L0) & (depth < 3.5 * stretch * L0)
    assert n[second].max() < n[middle].min() - 1e-4
    assert (n + more)[second] == pytest.approx(n[middle][0], rel=1e-12)
    assert not more[middle].any()


def test_water_at_rest_beside_walls_stays_at_rest():
    """A hundred steps from the lattice: with a surface that met the walls aslant speeds grew to 1 % of sqrt(g l0)."""
    spacing = 0.05
    simulation = build(load("hydrostatic", [f"spacing={spacing}", "fluid.water.disturbance=0.0"]), threads=1)
    for _ in range(100):
        simulation.advance()
    state = simulation.snapshot()
    speed = np.linalg.norm(state["velocity"][state.fluid], axis=1).max()
    assert speed < 2e-3 * np.sqrt(9.81 * spacing)
    depth = 1.0 - state["position"][state.fluid][:, 1]
    assert state["pressure"][state.fluid] == pytest.approx(9810.0 * depth, abs=1e-3 * 9810.0 * spacing)


@dimensions
def test_no_divergence_where_a_surface_is_stretched_and_sinks(d):
    def stretching(x):
        return 3.0 * np.column_stack([x[:, 0], *(0 * x[:, 1:-1].T), -x[:, -1]])

    (lattice, particles, pairs), _, top = layer(d, velocity=stretching)
    x = particles.numpy("position")[:, 0]
    rows = top & (x > 2.2 * L0) & (x < 5.8 * L0)
    assert rows.any()
    for scheme, exact in ((Bounded(floor=0.4), True), (OriginalDivergence(), False)):
        scheme(lattice, particles, pairs, out="answer")
        error = np.abs(particles.numpy("answer")[rows]).max()
        assert (error < 1e-10) == exact
        assert exact or error > 0.5


def rotation(d, omega=2.0):
    return omega * np.pad(np.array([[0.0, -1.0], [1.0, 0.0]]), (0, d - 2))


@dimensions
def test_a_rotation_keeps_its_volume_to_second_order(d):
    """-1/2 tr((grad u)^2) = omega^2, and the target of div u leaves det(I + dt grad u) = 1 + O(dt^3)."""
    G = rotation(d)
    (lattice, particles, pairs), depth, _ = layer(d, velocity=lambda x: x @ G.T)
    x = particles.numpy("position")[:, :-1]
    rows = np.all((x > 2.2 * L0) & (x < 5.8 * L0), axis=1) & (depth > 2.1 * L0) & (depth < 3.9 * L0)
    assert rows.any()
    particles.set("source", np.full(particles.count, 7.0))
    keep_volume(Bounded(), lattice, particles, pairs, False)
    found = particles.numpy("source") - 7.0
    assert found[rows] == pytest.approx(4.0, rel=1e-10)
    particles.set("surface_share", np.ones(particles.count))
    particles.set("source", np.zeros(particles.count))
    keep_volume(Bounded(), lattice, particles, pairs, False)
    assert not particles.numpy("source").any(), "it fades out towards the surface"
    change = []
    for dt in (1e-2, 5e-3):
        rest = found[rows][0] * dt  # a source S of a velocity without divergence leaves div u = -S dt
        step = G - rest / d * np.eye(d)
        change.append(abs(np.linalg.det(np.eye(d) + dt * step) - 1.0))
        assert change[-1] < 0.2 * abs(np.linalg.det(np.eye(d) + dt * G) - 1.0)
    assert change[0] / change[1] > 6.0


@dimensions
def test_shifting_along_a_flat_surface(d):
    """Across it nothing; along it the rows that crowd part; spray stays, and so does water that does not move."""
    (lattice, particles, pairs), _, top = layer(d)
    x = particles.numpy("position")
    rng = np.random.default_rng(1)
    moved = x.copy()
    moved[top, 0] += 0.2 * L0 * rng.uniform(-1, 1, top.sum())
    particles.set("position", moved)
    number_density = NumberDensity()
    number_density(lattice, particles, pairs)
    particles.set("surface_share", top.astype(float))
    shifting = FickianAlongSurface()
    shifting(lattice, particles, pairs, number_density, 0.01)
    assert not particles.numpy("shift").any()
    particles.set("velocity", rng.uniform(-1, 1, moved.shape))
    shifting(lattice, particles, pairs, number_density, 0.01)
    shift, normal = particles.numpy("shift")[top], particles.numpy("surface_normal")[top]
    assert np.abs(shift).max() > 1e-3 * L0
    assert np.abs((shift * normal).sum(axis=1)).max() < 1e-12
    particles.set("position", moved)
    FickianAlongSurface(spray=0.9, supported=0.95)(lattice, particles, pairs, number_density, 0.01)
    assert not particles.numpy("shift")[top].any()


@dimensions
@pytest.mark.parametrize("stretch", [1.0, 0.9])
def test_the_row_below_a_flat_surface_is_not_shifted(d, stretch):
    """It misses the neighbour two spacings above; the images of the surface are in its place."""
    number_density = NumberDensity()
    velocity = np.random.default_rng(2).uniform(-1, 1, (8 ** (d - 1) * 7, d))
    (lattice, particles, pairs), depth, top = layer(d, 1.0, stretch, velocity=lambda x: velocity)
    particles.set("surface_share", top.astype(float))
    number_density(lattice, particles, pairs)
    surface_images(ImagedSurface(), lattice, particles, pairs)
    particles.set("surface_distance", np.full(particles.count, 0.5 * stretch * L0))
    particles.set("images_near", np.full(particles.count, 7.0))  # other functions keep things there
    x = particles.numpy("position")
    second = (depth > 0.5 * stretch * L0) & (depth < 1.5 * stretch * L0)
    middle = (depth > 2.5 * stretch * L0) & (depth < 3.5 * stretch * L0)
    upward = {}
    for share, images in ((1.0, False), (1.0, True), (0.5, True)):
        particles.set("position", x)
        particles.set("surface_share", share * top)
        FickianAlongSurface(images=images)(lattice, particles, pairs, number_density, 0.01)
        assert np.abs(particles.numpy("shift")[middle]).max() < 1e-9 * L0
        upward[share, images] = particles.numpy("shift")[second][:, -1]
    assert upward[1.0, False].min() > 1e-4 * L0
    assert np.abs(upward[1.0, True]).max() < 1e-9 * L0
    assert upward[0.5, True] == pytest.approx(0.5 * upward[1.0, False], rel=1e-9), "half of them make up for half"


@dimensions
def test_images_crowd_no_row(d):
    """Where they lie on the fluid's side, as in a sheet with images of both its faces, they are left out."""
    number_density = NumberDensity()
    velocity = np.random.default_rng(2).uniform(-1, 1, (8 ** (d - 1) * 7, d))
    (lattice, particles, pairs), _, top = layer(d, velocity=lambda x: velocity)
    particles.set("surface_share", top.astype(float))
    number_density(lattice, particles, pairs)
    surface_images(ImagedSurface(), lattice, particles, pairs)
    particles.set("images", -particles.numpy("images"))
    particles.set("surface_distance", np.full(particles.count, 0.75 * L0))  # half a spacing below the second row
    x, found = particles.numpy("position"), []
    for images in (True, False):
        particles.set("position", x)
        FickianAlongSurface(images=images)(lattice, particles, pairs, number_density, 0.01)
        found.append(particles.numpy("shift"))
    assert found[0] == pytest.approx(found[1], abs=1e-12 * L0)
    assert np.abs(particles.numpy("images_crowding")).max() > 0.1 / L0


@dimensions
def test_crowding_of_images_is_the_sum_over_them(d):
    """By a plain loop, on rows out of their places; rows of spray have no images."""
    (lattice, particles, pairs), _, _ = layer(d)
    rng = np.random.default_rng(3)
    particles.set("position", particles.numpy("position") + 0.1 * L0 * rng.uniform(-1, 1, (particles.count, d)))
    pairs.update(particles)
    x = particles.numpy("position")
    top = x[:, -1] > -0.5 * L0
    share, n = np.where(top, rng.uniform(0.2, 1.0, top.size), 0.0), rng.uniform(4.0, 8.0, top.size)
    b, delta = rng.uniform(-1, 1, x.shape), L0 * rng.uniform(0.3, 0.7, top.size)
    for name, values in (("surface_share", share), ("number_density", n), ("images", b), ("surface_distance", delta)):
        particles.set(name, values)
    scheme = FickianAlongSurface()
    crowding_of_images(scheme, lattice, particles, pairs, 5.0, 7.0)
    near, found = particles.numpy("images_near") > 0, particles.numpy("images_crowding")
    period, re = 8 * L0, 2.1 * L0
    n0 = lattice.n0(scheme.weight, 2.1)
    for i in range(particles.count):
        total = np.zeros(d)
        for j in np.flatnonzero(share):
            r = x[j] - x[i]
            r[:-1] -= period * np.round(r[:-1] / period)
            s = np.linalg.norm(r)
            away = r - 2.0 * delta[j] * b[j] / np.linalg.norm(b[j])
            if j != i and s < re and np.linalg.norm(away) < re:
                beta = min(max((n[j] - 5.0) / 2.0, 0.0), 1.0)
                w = float(scheme.weight.values(np.array([np.linalg.norm(away) / L0]), 2.1)[0])
                total += d / n0 * share[j] * beta * w * away / (away @ away)
        if near[i]:
            assert found[i] == pytest.approx(total, rel=1e-9, abs=1e-9 / L0)
        else:
            assert not total.any()


def test_mean_of_a_constant_error_is_that_constant():
    """Every row of the lattice as dense as the wall beside it; and a mean it is, of a row and its neighbours."""
    (lattice, particles, pairs), _, _ = layer(2, velocity=lambda x: 0.0 * x)
    number_density, dt = NumberDensity(), 0.01
    n0 = number_density.n0(lattice)
    for ratio in (np.full(particles.count, 1.02), 1.0 + 0.02 * np.cos(np.arange(particles.count))):
        found = []
        for smoothed in (False, True):
            particles.set("number_density", ratio * n0)
            DivergenceDensity(gamma=0.5, smoothed=smoothed)(
                lattice, particles, pairs, dt, OriginalDivergence(), number_density, False
            )
            found.append(-particles.numpy("source") * dt**2 / 0.5)
        assert found[0] == pytest.approx(ratio - 1.0, abs=1e-12)
        if np.ptp(ratio) == 0.0:
            assert found[1] == pytest.approx(0.02, rel=1e-10)
        else:
            assert np.std(found[1]) < 0.6 * np.std(found[0])


@dimensions
@pytest.mark.parametrize("weight", [Inverse(), Quadratic()], ids=lambda w: w.key)
def test_share_that_a_flat_surface_misses(d, weight):
    """By a direct sum over the layers above a row."""
    cells = np.stack(np.meshgrid(*[np.arange(-3, 4)] * d, indexing="ij"), -1).reshape(-1, d)
    r = np.linalg.norm(cells, axis=1)
    near = (r > 0) & (r < 2.1)
    w = np.where(near, weight.values(np.where(near, r, 1.0), 2.1), 0.0)
    expected = w[cells[:, -1] > 0].sum() / w.sum()
    assert Lattice(d, L0).missing(weight, 2.1) == pytest.approx(expected, rel=1e-12)


@dimensions
def test_water_at_rest_needs_no_neighbours(d):
    """What the floor adds is water at rest: a hydrostatic pressure is exact whatever the floor, at the surface too."""
    (lattice, particles, pairs), depth, top = layer(d, 1.2, 0.8)
    particles.set("surface_share", top.astype(float))
    surface_images(ImagedGradient(), lattice, particles, pairs)
    particles.set("scalar", weight_of(depth, distance_of_surface(particles, top)))
    down = np.zeros((particles.count, d))
    down[:, -1] = -9.81
    particles.set("density", np.full(particles.count, 1000.0))
    above = depth < 4.5 * 0.8 * L0  # the layer's lower side is open too
    for acceleration, exact in ((down, True), (0.0 * down, False)):
        particles.set("acceleration", acceleration)
        ImagedGradient(floor=1.0)(lattice, particles, pairs, phi="scalar", out="vector")
        off = np.abs(particles.numpy("vector") - 1000.0 * down)[above].max()
        assert (off < 1e-6) == exact, off


@pytest.mark.parametrize("air", [0.0, 700.0])
@pytest.mark.parametrize(("pressure", "share"), [(0.0, 0.0), (0.125, 0.5), (0.25, 1.0), (5.0, 1.0)])
def test_what_has_no_pressure_is_not_held_up(pressure, share, air):
    """A row with one neighbour, at the same pressure: the floor carries as much of it as its pressure says.

    What counts is how much that is above the pressure of enclosed air.
    """
    x = np.array([[0.0, 0.0], [0.9 * L0, 0.0]])
    lattice, particles, pairs = table(x, spacing=L0, fields=FIELDS, skin=0.0)
    weight = 1000.0 * np.array([[0.0, -9.81]] * 2)
    particles.set("acceleration", weight / 1000.0)
    particles.set("density", np.full(2, 1000.0))
    particles.set("scalar", np.full(2, pressure * 9810.0 * L0 + air))
    particles.set("air_pressure", np.full(2, air))
    ImagedGradient()(lattice, particles, pairs, phi="scalar", out="vector")
    assert particles.numpy("vector") == pytest.approx(share * weight, rel=1e-9, abs=1e-9)
