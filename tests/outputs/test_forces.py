"""Forces of water at rest on bodies: the weight of the water that they displace, wherever they stand."""

import numpy as np
import pytest

import spume
from spume.outputs.gauges import Force
from tanks import advanced

L0, RHO_G = 0.02, 9810.0


def pool(body, size, depth, **more):
    """Return water at rest around a body in a tank; the last of the sizes is the tank's height."""
    zero = [0.0] * len(size)
    water = spume.Box(lower=zero, upper=[*size[:-1], depth])
    return spume.Case(
        spacing=L0, dimension=len(size), time=spume.Time(end=1.0),
        fluid=[spume.Fluid(name="water", shape=spume.Difference(of=water, without=[body]), initial="hydrostatic")],
        body=[
            spume.Wall(name="body", shape=body, **more),
            spume.Wall(name="tank", shape=spume.Tank(lower=zero, upper=size, open=["top"])),
        ],
    )  # fmt: skip


def force(simulation, body="body", **more):
    return Force(name="f", body=body, **more).measure(simulation.snapshot())


@pytest.mark.parametrize("cells", [5, 10])
def test_a_submerged_box(device, cells):
    side = cells * L0
    box = spume.Box(lower=[0.2, 0.1], upper=[0.2 + side, 0.1 + side])
    simulation = advanced(pool(box, [0.6, 0.6], 0.5).build(device=device, threads=1), steps=3)
    found = force(simulation, origin=(0.2 + side / 2, 0.1 + side / 2))
    weight = RHO_G * side**2
    assert found["force_y"] == pytest.approx(weight, rel=1e-3)
    assert found["force_x"] == pytest.approx(0.0, abs=1e-4 * weight)
    assert found["moment_z"] == pytest.approx(0.0, abs=1e-4 * weight * side)


def test_a_submerged_box_in_space(device):
    side = 6 * L0
    box = spume.Box(lower=[0.12, 0.1, 0.08], upper=[0.12 + side, 0.1 + side, 0.08 + side])
    simulation = advanced(pool(box, [0.36, 0.32, 0.4], 0.32).build(device=device, threads=1), steps=2)
    found = force(simulation)
    weight = RHO_G * side**3
    assert found["force_z"] == pytest.approx(weight, rel=1e-3)
    assert found["moment_x"] == pytest.approx(weight * (0.1 + side / 2), rel=2e-3)
    assert found["moment_y"] == pytest.approx(-weight * (0.12 + side / 2), rel=2e-3)


def test_a_box_that_pierces_the_surface(device):
    box = spume.Box(lower=[0.2, 0.3], upper=[0.4, 0.5])
    simulation = pool(box, [0.6, 0.6], 0.4).build(device=device, threads=1)
    advanced(simulation, steps=2)
    assert force(simulation)["force_y"] == pytest.approx(RHO_G * 0.2 * 0.1, rel=1e-3)


@pytest.mark.parametrize("depth_in_floor", [0.0, 3 * L0], ids=["on the floor", "in the floor"])
@pytest.mark.parametrize("d", [2, 3])
def test_a_wall_that_stands_on_a_floor(device, d, depth_in_floor):
    """Water on one side of it: ρ g h²/2 a metre of width, at a third of the depth, as on the tank's own wall."""
    h, width = 10 * L0, 8 * L0
    across, beyond = ([0.0], [width]) if d == 3 else ([], [])
    e = depth_in_floor
    shape = spume.Box(
        lower=[0.3, *(a - e for a in across), -e], upper=[0.4, *(b + e for b in beyond), 0.3]
    )  # fmt: skip
    size = [0.6, *beyond, 0.3]
    water = spume.Box(lower=[0.0] * d, upper=[0.3, *beyond, h])
    case = spume.Case(
        spacing=L0, dimension=d, time=spume.Time(end=1.0),
        fluid=[spume.Fluid(name="water", shape=water, initial="hydrostatic")],
        body=[
            spume.Wall(name="body", shape=shape),
            spume.Wall(name="tank", shape=spume.Tank(lower=[0.0] * d, upper=size, open=["top"])),
        ],
    )  # fmt: skip
    simulation = advanced(case.build(device=device, threads=1), steps=2)
    exact = 0.5 * RHO_G * h**2 * (width if d == 3 else 1.0)
    found, own = force(simulation), force(simulation, "tank")
    assert found["force_x"] == pytest.approx(exact, rel=4e-3)
    assert own["force_x"] == pytest.approx(-exact, rel=4e-3)
    moment = -found["moment_z"] if d == 2 else found["moment_y"]
    assert moment == pytest.approx(exact * h / 3, rel=0.01)


def test_a_channel_without_ends(device):
    """Through a periodic boundary the floor goes on: it has no face there."""
    case = spume.Case(
        spacing=L0, time=spume.Time(end=1.0),
        domain=spume.Domain(periodic=["x"], lower=[0.0, -0.2], upper=[0.4, 0.6]),
        fluid=[spume.Fluid(name="water", shape=spume.Box(lower=[0.0, 0.0], upper=[0.4, 0.2]), initial="hydrostatic")],
        body=[spume.Wall(name="body", shape=spume.Tank(
            lower=[0.0, 0.0], upper=[0.4, 0.3], open=["left", "right", "top"]
        ))],
    )  # fmt: skip
    simulation = advanced(case.build(device=device, threads=1), steps=2)
    found = force(simulation)
    assert found["force_y"] == pytest.approx(-RHO_G * 0.4 * 0.2, rel=1e-3)
    assert found["force_x"] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("degrees", [0.0, 30.0])
def test_a_turned_body_has_the_force_turned(degrees):
    """The faces turn with the body: the same snapshot, seen from a frame that is turned, gives the force turned."""
    box = spume.Box(lower=[0.2, 0.1], upper=[0.4, 0.3])
    simulation = pool(box, [0.6, 0.5], 0.4).build(threads=1)
    snapshot = simulation.snapshot()
    before = Force(name="f", body="body").measure(snapshot)
    pose = spume.motion.Pose(spume.motion.pose.rotation(np.array([0.0, 0.0, 1.0]), np.radians(degrees), 2), np.zeros(2))
    turned = {
        name: (pose.turned(np.asarray(snapshot[name])) if name in ("position", "to_surface", "wall_acceleration")
               else np.asarray(snapshot[name]))
        for name in Force.reads
    }  # fmt: skip
    other = spume.outputs.snapshot.Snapshot(
        turned.__getitem__, time=0.0, step=0, dt=0.0, spacing=L0, dimension=2, gravity=pose.turned(snapshot.gravity),
        bodies=snapshot.bodies, poses={"body": pose},
    )  # fmt: skip
    after = Force(name="f", body="body").measure(other)
    expected = pose.turned(np.array([before["force_x"], before["force_y"]]))
    assert [after["force_x"], after["force_y"]] == pytest.approx(expected, abs=1e-6)
    assert after["moment_z"] == pytest.approx(before["moment_z"], abs=1e-6)
