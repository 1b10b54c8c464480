"""Water in moving tanks against exact solutions, and the two frames of reference against each other."""

import numpy as np
import pytest

import spume
from spume.particles import FLUID
from spume.pressure.conjugate_gradient import ConjugateGradient
from spume.pressure.multigrid import Multigrid
from spume.steps.project_in_place import ProjectInPlace
from tanks import by_id

RHO, G, L0 = 1000.0, 9.81, 0.025
EXACT = ProjectInPlace(solver=ConjugateGradient(tolerance=1e-10))


def tank(frame="laboratory", motion=None, cells=(12, 8), step=EXACT, closed=False, bodies=(), width=None, **time):
    size = [cells[0] * L0, cells[1] * L0]
    roof = [size[0] if width is None else width, size[1] if closed else 2 * size[1]]
    return spume.Case(
        spacing=L0, time=spume.Time(end=10.0, **time), step=step,
        domain=spume.Domain(frame=frame, motion=motion),
        fluid=[spume.Fluid(name="water", shape=spume.Box(lower=[0.0, 0.0], upper=size), initial="hydrostatic")],
        body=[spume.Wall(name="tank", shape=spume.Tank(lower=[0.0, 0.0], upper=roof)), *bodies],
    )  # fmt: skip


def built(case, device):
    return case.build(device=device, threads=1, precision="double")


def in_the_tank(simulation):
    """Return position and pressure of the water in the tank's coordinates, by id."""
    snapshot = simulation.snapshot().seen_from("tank")
    fluid = snapshot.fluid
    order = np.argsort(snapshot["id"][fluid])
    return snapshot["position"][fluid][order], snapshot["pressure"][fluid][order]


def test_a_tank_at_constant_velocity_is_at_rest(device):
    """Galilean invariance: full of water or half, in a tank that moves on, the same as in one that stands."""
    velocity = np.array([3.0, -0.7])
    moving = built(tank(motion={"kind": "uniform", "velocity": velocity.tolist()}, step_max=0.001), device)
    standing = built(tank(step_max=0.001), device)
    for simulation in (moving, standing):
        for _ in range(40):  # of step_max: the walls' speed limits neither
            simulation.advance()
    assert moving.time == pytest.approx(standing.time)
    (x, p), (y, q) = in_the_tank(moving), in_the_tank(standing)
    assert x == pytest.approx(y, abs=1e-7 * L0)
    assert p == pytest.approx(q, abs=1e-5 * RHO * G * 0.2)
    assert by_id(moving, "position") == pytest.approx(x + velocity * moving.time, abs=1e-12)
    assert by_id(moving, "velocity") - velocity == pytest.approx(by_id(standing, "velocity"), abs=1e-6)


@pytest.mark.parametrize("frame", ["laboratory", "tank"])
def test_a_tank_that_accelerates_tilts_the_pressure(device, frame):
    """Closed and full, so that nothing can move: grad P = rho (g - a) inside the water, in either frame."""
    a, ramp = 4.0, 0.02
    # x = a t^2/2 near the top of a slow sine: a = -A omega^2 at its crest.
    omega = 2.0
    motion = {"kind": "sinusoid", "amplitude": [-a / omega**2, 0.0], "period": 2 * np.pi / omega, "phase_deg": 90.0}
    simulation = built(tank(frame, motion, closed=True), device)
    while simulation.time < ramp:
        simulation.advance()
    x, p = in_the_tank(simulation)
    size = np.array([12 * L0, 8 * L0])
    inner = np.all((x > 2.5 * L0) & (x < size - 2.5 * L0), axis=1)
    slope = np.linalg.lstsq(np.column_stack([x[inner], np.ones(inner.sum())]), p[inner], rcond=None)[0][:2]
    assert slope == pytest.approx(RHO * np.array([-a, -G]), rel=0.02)


def test_both_frames_give_the_same_sloshing(device):
    """Roll and sway through half a period at an amplitude that moves the water visibly."""
    motion = {"kind": "sinusoid", "amplitude": [0.02, 0.0], "amplitude_deg": 4.0, "period": 0.8, "phase_deg": 90.0,
              "centre": [0.2, 0.1]}  # fmt: skip
    seen = {}
    for frame in ("laboratory", "tank"):
        simulation = built(tank(frame, motion, cells=(16, 6)), device)
        gauge = spume.outputs.gauges.pressure.Pressure(name="p", at=(0.0, 0.05), body="tank")
        level = spume.outputs.gauges.elevation.Elevation(name="h", at=(0.05,), body="tank")
        rows = []
        while simulation.time < 0.5:
            simulation.advance()
            snapshot = simulation.snapshot()
            x, _ = in_the_tank(simulation)
            measured = gauge.measure(snapshot)["pressure"], level.measure(snapshot)["elevation"]
            rows.append((simulation.time, *measured, *x.mean(axis=0)))
        seen[frame] = np.array(rows)
    t = np.linspace(0.02, 0.5, 60)
    one, other = (np.array([np.interp(t, s[:, 0], s[:, k]) for k in range(1, 5)]) for s in seen.values())
    rms = np.sqrt(np.mean((one - other) ** 2, axis=1))
    assert np.ptp(one[2]) > 0.25 * L0, "the water moves"
    assert rms[0] < 0.03 * RHO * G * 6 * L0
    assert rms[1] < 0.15 * L0
    assert rms[2] < 0.05 * np.ptp(one[2])


def plate(**more):
    return spume.Wall(name="gate", shape=spume.Box(lower=[0.3, 0.0], upper=[0.375, 0.4]), **more)


def test_a_plate_holds_a_column(device):
    """Water on one side stays there, with its pressure; the dry face of the plate feels none."""
    case = tank(cells=(12, 8), width=0.6, bodies=[plate()])
    simulation = built(case, device)
    for _ in range(60):
        simulation.advance()
    x, p = in_the_tank(simulation)
    assert len(x) == 96
    assert x[:, 0].max() < 0.3
    height = 8 * L0
    assert np.abs(p - RHO * G * (height - x[:, 1])).max() < 0.03 * RHO * G * height
    snapshot = simulation.snapshot()
    wall = (snapshot["kind"] != FLUID) & (snapshot["body"] == 1)
    dry = wall & (snapshot["to_surface"][:, 0] > 0)
    assert dry.sum() > 0
    wet = wall & (snapshot["to_surface"][:, 0] < 0) & (snapshot["position"][:, 1] < height / 2)
    assert np.abs(snapshot["pressure"][dry]).max() < 0.02 * RHO * G * height
    assert snapshot["pressure"][wet].min() > 0.3 * RHO * G * height


def test_waters_on_two_sides_do_not_see_each_other(device):
    """A plate between a deep and a shallow water: either is as if the other were not there, to round-off."""
    deep = {"name": "deep", "shape": {"kind": "box", "lower": [0.0, 0.0], "upper": [0.3, 0.2]}}
    shallow = {"name": "shallow", "shape": {"kind": "box", "lower": [0.375, 0.0], "upper": [0.6, 0.1]}}
    found = {}
    for waters in ((deep, shallow), (deep,), (shallow,)):
        case = tank(width=0.6, bodies=[plate()], step_max=0.001)
        both = tuple(spume.Fluid(**water, initial="hydrostatic") for water in waters)
        # The mean of the residual over both waters decides when a solve ends: it must not matter.
        step = case.step.model_copy(update={"solver": Multigrid(tolerance=1e-7, volume_error=0.0)})
        simulation = built(case.model_copy(update={"fluid": both, "step": step}), device)
        for _ in range(5):
            simulation.advance()
        x, p = by_id(simulation, "position", "pressure")
        found[len(waters), waters[0]["name"]] = x, p
    alone = [np.concatenate([found[1, "deep"][k], found[1, "shallow"][k]]) for k in range(2)]
    assert found[2, "deep"][0] == pytest.approx(alone[0], abs=1e-9)
    assert found[2, "deep"][1] == pytest.approx(alone[1], abs=1e-4 * RHO * G * 0.2)


def test_a_plate_too_thin_is_refused():
    thin = spume.Wall(name="gate", shape=spume.Box(lower=[0.3, 0.0], upper=[0.35, 0.4]))
    with pytest.raises(spume.CaseError, match=r"body.1.shape: 0.05 m thick at .*at least as thick as the largest re"):
        tank(width=0.6, bodies=[thin]).build()
    low = spume.Wall(name="step", shape=spume.Box(lower=[0.4, 0.0], upper=[0.5, 0.05]))
    tank(width=0.6, bodies=[low]).build()
