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
    assert force["force_z"] == pytest.approx(buoyancy, rel=0.1)
    assert abs(force["force_x"]) + abs(force["force_y"]) < 0.1 * buoyancy


@pytest.mark.parametrize("wetted", ["inside", "outside"])
@pytest.mark.parametrize("d", [2, 3])
def test_areas_of_the_rows_of_a_sphere_add_up_to_its_own(d, wetted):
    random = np.random.default_rng(0)
    ratio = []
    for _ in range(8):
        ball = spume.Sphere(centre=tuple(random.uniform(0, 1, d)), radius=8.0)
        layers = wall_layers(ball, Grid((0.0,) * d, 1.0), 3, wetted=wetted)
        assert not layers.face_area[~layers.wall].any()
        ratio.append(layers.face_area.sum() / ball.surface())
    assert np.mean(ratio) == pytest.approx(1.0, abs=0.015)
    assert np.abs(np.array(ratio) - 1.0).max() < 0.05


@pytest.mark.parametrize("degrees", [15.0, 30.0, 45.0])
def test_areas_behind_a_slope(degrees):
    slope = np.tan(np.radians(degrees))
    wedge = spume.Polygon(vertices=[[0.0, 0.0], [100.0, 0.0], [100.0, 100.0 * slope]])
    layers = wall_layers(wedge, Grid((0.0, 0.0), 1.0), 3, wetted="outside")
    normal = layers.to_surface / np.linalg.norm(layers.to_surface, axis=1, keepdims=True)
    slanted = (normal[:, 1] > 0.1) & (np.abs(normal[:, 0]) > 0.1)
    assert layers.face_area[slanted].sum() == pytest.approx(np.hypot(100.0, 100.0 * slope), rel=0.04)
