"""Water at rest on slanted and around curved walls: hydrostatic pressure, no leak, areas of the walls."""

import numpy as np
import pytest

import spume
from spume.geometry import Grid, wall_layers
from spume.outputs.gauges import Force
from spume.particles import FLUID
from tanks import advanced

L0 = 0.05
RHO_G = 9810.0


def pool(obstacle, size, disturbance=0.0):
    """Return the case of a tank of water around or above an obstacle."""
    d = len(size)
    box = spume.Box(lower=[0.0] * d, upper=size)
    tank = spume.Tank(lower=[0.0] * d, upper=[*size[:-1], size[-1] + 4 * L0], open=["top"])
    water = spume.Fluid(
        name="w", shape=spume.Difference(of=box, without=obstacle), initial="hydrostatic", disturbance=disturbance
    )
    walls = [spume.Wall(name="tank", shape=tank), spume.Wall(name="obstacle", shape=obstacle)]
    return spume.Case(dimension=d, spacing=L0, time=spume.Time(end=10.0), fluid=[water], body=walls)


def ramp(degrees, shift):
    """Return a floor that rises to the right, its surface `shift` above the origin."""
    slope = np.tan(np.radians(degrees))
    surface = [[1.2, 1.2 * slope + shift], [-0.3, -0.3 * slope + shift]]
    return spume.Polygon(vertices=[[-0.3, -0.5], [1.2, -0.5], *surface])


def check(simulation, obstacle, depth, tolerance):
    kind = simulation.fetch("kind")
    x, p = (simulation.fetch(name)[kind == FLUID] for name in ("position", "pressure"))
    speed = np.linalg.norm(simulation.fetch("velocity")[kind == FLUID], axis=1)
    inner = x[:, -1] < depth - 2 * L0
    plane = np.column_stack([x[inner], np.ones(inner.sum())])
    slope = np.linalg.lstsq(plane, p[inner], rcond=None)[0][:-1] / RHO_G
    assert slope == pytest.approx([0.0] * (len(slope) - 1) + [-1.0], abs=tolerance)
    near = obstacle.distance(x) < 1.5 * L0
    assert near.any()
    exact = RHO_G * (depth - x[:, -1])
    assert p[near] == pytest.approx(exact[near], abs=3 * tolerance * RHO_G * depth)
    assert obstacle.distance(x).min() > -0.05 * L0
    assert x.min() > 0.0
    return speed.max()


@pytest.mark.parametrize(("degrees", "shift"), [(30.0, 0.0), (45.0, 0.0), (45.0, L0)])
def test_column_above_a_slope(device, degrees, shift):
    """At 45 degrees through the middles of cells, rows on the surface itself must know their normal."""
    obstacle = ramp(degrees, shift)
    simulation = advanced(pool(obstacle, [1.0, 0.8]).build(device=device, threads=1), steps=10)
    assert check(simulation, obstacle, 0.8, 0.005) < 0.02
    solid = simulation.fetch("kind") != FLUID
    assert np.linalg.norm(simulation.fetch("to_surface")[solid], axis=1).min() > 0.5e-4 * L0


def test_disturbed_column_above_a_slope(device):
    obstacle = ramp(30.0, 0.01)
    simulation = advanced(pool(obstacle, [1.0, 0.8], 0.1).build(device=device, threads=1), until=0.5)
    assert check(simulation, obstacle, 0.8, 0.02) < 0.3


def test_column_around_a_sphere(device):
    """Pressure as without it, and the force on it is the weight of the water that it displaces."""
    ball = spume.Sphere(centre=[0.31, 0.29, 0.28], radius=0.2)
    simulation = advanced(pool(ball, [0.6, 0.6, 0.6]).build(device=device, threads=1), steps=4)
    assert check(simulation, ball, 0.6, 0.01) < 0.1
    force = Force(name="f", body="obstacle").measure(simulation.snapshot())
    buoyancy = RHO_G * ball.measure()
    assert force["force_z"] == pytest.approx(buoyancy, rel=0.03)
    assert max(abs(force["force_x"]), abs(force["force_y"])) < 0.001 * buoyancy


def shadows(layers, d):
    """Return how many faces look along each axis, lower and upper: areas of the shadows, shape (d, 2)."""
    bits = layers.exposed[layers.wall]
    return np.array([[np.count_nonzero(bits & (4**k << upper)) for upper in range(2)] for k in range(d)])


@pytest.mark.parametrize("d", [2, 3])
def test_faces_of_a_sphere_have_its_shadow(d):
    """From either side and along every axis the same; on average that of the sphere."""
    random = np.random.default_rng(0)
    ratio = []
    for _ in range(8):
        ball = spume.Sphere(centre=tuple(random.uniform(0, 1, d)), radius=8.0)
        layers = wall_layers(ball, Grid((0.0,) * d, 1.0), 20, wetted="outside")
        faces = shadows(layers, d)
        assert np.array_equal(faces[:, 0], faces[:, 1])
        ratio.extend(faces[:, 0] / (16.0 if d == 2 else np.pi * 64.0))
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.015)
    assert np.abs(np.array(ratio) - 1.0).max() < 0.05


@pytest.mark.parametrize("degrees", [15.0, 30.0, 45.0])
def test_faces_of_a_slope_have_its_shadows(degrees):
    slope = np.tan(np.radians(degrees))
    wedge = spume.Polygon(vertices=[[0.0, 0.0], [100.0, 0.0], [100.0, 100.0 * slope]])
    layers = wall_layers(wedge, Grid((0.0, 0.0), 1.0), 200, wetted="outside")
    faces = shadows(layers, 2)
    assert faces[1] == pytest.approx([100, 100], abs=2)
    assert faces[0] == pytest.approx(np.full(2, 100.0 * slope), abs=2)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("wetted", ["inside", "outside"])
def test_faces_of_a_box(d, wetted):
    """Along the lattice every face of the box has its own area, edges and corners included."""
    box = spume.Box(lower=(0.0,) * d, upper=(5.0, 7.0, 6.0)[:d])
    layers = wall_layers(box, Grid((0.0,) * d, 1.0), 3, wetted=wetted)
    sides = np.array([5, 7, 6][:d])
    expected = np.prod(sides) // sides
    assert np.array_equal(shadows(layers, d), np.stack([expected, expected], axis=1))
