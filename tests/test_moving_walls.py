"""Bodies that move in the laboratory: in every step, from any time on, and what they do to the time step."""

import numpy as np
import pytest

import spume
from spume.motion import Sinusoid, Uniform
from spume.particles import SOLID
from spume.schemes.collision.inelastic import Inelastic
from spume.schemes.free_surface.blended import Blended
from spume.schemes.free_surface.detection_free import DetectionFree
from spume.schemes.gradient.corrected import Corrected
from spume.schemes.source.divergence import VelocityDivergence
from spume.steps.predict_move_project import PredictMoveProject
from spume.steps.project_in_place import ProjectInPlace
from spume.steps.weakly_compressible import WeaklyCompressible
from spume.wall_models.neumann import Neumann
from spume.wall_models.resting import Resting
from tanks import by_id

L0 = 0.025
STEPS = [ProjectInPlace(), PredictMoveProject(), WeaklyCompressible(speed_of_sound=20.0)]


def case(motion, step, **more):
    """Return water in a tank, beside a block that hangs above it and moves."""
    return spume.Case(
        spacing=L0, time=spume.Time(end=3.0), step=step, **more,
        fluid=[spume.Fluid(name="water", shape=spume.Box(lower=[0.0, 0.0], upper=[0.3, 0.2]))],
        body=[
            spume.Wall(name="tank", shape=spume.Tank(lower=[0.0, 0.0], upper=[0.3, 0.6], open=["top"])),
            spume.Wall(name="block", shape=spume.Box(lower=[0.1, 0.35], upper=[0.2, 0.45]), motion=motion),
        ],
    )  # fmt: skip


@pytest.mark.parametrize("step", STEPS, ids=lambda step: step.key)
def test_a_body_is_where_its_motion_puts_it(device, step):
    velocity = np.array([0.05, 0.2])
    simulation = case(Uniform(velocity=velocity.tolist()), step).build(device=device, threads=1)
    names = ("position", "to_surface", "body")
    start, surface, body = by_id(simulation, *names, kinds=SOLID)
    for _ in range(8):
        simulation.advance()
    x, to_surface, _ = by_id(simulation, *names, kinds=SOLID)
    block = (body == 1)[:, None]
    assert simulation.time > 1e-3
    assert x == pytest.approx(start + block * velocity * simulation.time, abs=1e-12)
    assert to_surface == pytest.approx(surface, abs=1e-12)


@pytest.mark.parametrize("frame", ["laboratory", "tank"])
@pytest.mark.parametrize("begin", [{"ramp": 0.5}, {"start": 0.5}], ids=["ramp", "start"])
def test_a_motion_that_is_yet_to_begin_is_not_jumped_over(device, begin, frame):
    """Without gravity nothing limits the first step but what will be."""
    motion = Sinusoid(amplitude=[0.05, 0.0], period=0.8, **begin)
    shaken = spume.Case(
        spacing=L0, time=spume.Time(end=3.0), domain=spume.Domain(gravity=[0.0, 0.0], motion=motion, frame=frame),
        fluid=[spume.Fluid(name="water", shape=spume.Box(lower=[0.0, 0.0], upper=[0.2, 0.1]))],
        body=[spume.Wall(name="tank", shape=spume.Tank(lower=[0.0, 0.0], upper=[0.2, 0.1]))],
    )  # fmt: skip
    simulation = shaken.build(device=device, threads=1)
    fastest = 0.05 * 2 * np.pi / 0.8
    while simulation.time < 0.9:
        before = motion.pose(simulation.time, 2).shift
        simulation.advance()
        way = np.linalg.norm(motion.pose(simulation.time, 2).shift - before)
        assert way < (0.3 if frame == "laboratory" else 1.0) * L0, simulation.time
    assert simulation.particles.largest_norm("velocity") < 2.0 * fastest


def test_a_gravity_that_grows_from_nothing_limits_the_first_step(device, tmp_path):
    table = tmp_path / "g.csv"
    table.write_text("time [s],x [m/s^2],y [m/s^2]\n0,0,0\n0.2,0,-9.81\n3,0,-9.81\n")
    calm = case(None, ProjectInPlace(), domain=spume.Domain(gravity={"kind": "table", "file": str(table)}))
    simulation = calm.build(device=device, threads=1)
    simulation.advance()
    assert simulation.dt < 0.3 * np.sqrt(L0 / 9.81)


def test_water_that_runs_over_the_rim_of_a_tank_stands_on_it(device):
    """It flows off outside and falls; none sinks into the wall, which would end the run."""
    l0 = 0.02
    full = spume.Case(
        spacing=l0, time=spume.Time(end=0.45),
        fluid=[spume.Fluid(name="water", shape=spume.Box(lower=[0.0, 0.0], upper=[0.2, 0.6]))],
        body=[spume.Wall(name="tank", shape=spume.Tank(lower=[0.0, 0.0], upper=[0.4, 0.3], open=["top"]))],
    )  # fmt: skip
    simulation = full.build(device=device, threads=1)
    over = 0
    while not simulation.done:
        simulation.advance()
        x = by_id(simulation, "position")
        beside = np.maximum(-x[:, 0], x[:, 0] - 0.4)
        over = max(over, int(np.count_nonzero((beside > l0) & (x[:, 1] > 0.3))))
        assert not np.any((beside > 0.5 * l0) & (beside < 2.4 * l0) & (x[:, 1] < 0.3 - 0.5 * l0) & (x[:, 1] > 0.0))
    assert over > 5


@pytest.mark.parametrize("wall_model", [Neumann(), Resting()], ids=lambda model: model.key)
@pytest.mark.parametrize("step", STEPS[:2], ids=lambda step: step.key)
def test_water_that_fills_a_shaken_box_moves_as_the_box_does(device, step, wall_model):
    """At the end of each step, not one step later: without gravity and a surface there is nothing else to do.

    Rows of resting walls have an equation and take part of the pressure's work, a third of what a step changes.
    """
    motion = Sinusoid(amplitude=[0.05, 0.0], period=0.8, phase_deg=90.0)
    # Where rows have moved before it is looked for, a surface is seen in a full box.
    surface = Blended() if step.key == "project-in-place" else DetectionFree()
    models = {
        "wall_model": wall_model, "source": VelocityDivergence(), "free_surface": surface, "gradient": Corrected(),
    }  # fmt: skip
    shaken = spume.Case(
        spacing=L0, time=spume.Time(end=3.0, step_max=0.004), domain=spume.Domain(gravity=[0.0, 0.0]),
        step=step.model_copy(update=models),
        fluid=[spume.Fluid(name="water", shape=spume.Box(lower=[0.0, 0.0], upper=[0.2, 0.15]))],
        body=[spume.Wall(name="box", shape=spume.Tank(lower=[0.0, 0.0], upper=[0.2, 0.15]), motion=motion)],
    )  # fmt: skip
    simulation = shaken.build(device=device, threads=1)
    part = 0.5 if wall_model == Resting() else 0.01
    before = np.zeros(2)
    for _ in range(12):
        simulation.advance()
        wall = by_id(simulation, "velocity", kinds=SOLID)[0]
        change = np.linalg.norm(wall - before)
        assert by_id(simulation, "velocity").mean(axis=0) == pytest.approx(wall, abs=part * change)
        before = wall


@pytest.mark.parametrize("wall_model", [Neumann(), Resting()], ids=lambda model: model.key)
def test_a_row_that_is_hit_by_a_wall_gets_its_velocity(device, wall_model):
    """Also where rows move before the pressure is solved for, when solid rows still have that of the step before."""
    step = PredictMoveProject(wall_model=wall_model, source=VelocityDivergence(), collision=Inelastic(restitution=0.0))
    hit = spume.Case(
        spacing=L0, time=spume.Time(end=3.0, step_max=0.002), domain=spume.Domain(gravity=[0.0, 0.0]), step=step,
        fluid=[spume.Fluid(name="drop", shape=spume.Box(lower=[0.0, 0.0], upper=[L0, L0]))],
        body=[spume.Wall(name="plate", motion=Sinusoid(amplitude=[0.0, -0.05], period=0.2, phase_deg=90.0),
                         shape=spume.Box(lower=[-0.15, -0.15], upper=[0.175, 0.0]))],
    )  # fmt: skip
    simulation = hit.build(device=device, threads=1)
    while not simulation.statistics.get("collisions"):
        simulation.advance()
        assert simulation.time < 0.05
    wall = by_id(simulation, "velocity", kinds=SOLID)[0]
    assert wall[1] > 0.1
    assert by_id(simulation, "velocity")[0] == pytest.approx(wall, abs=1e-3 * wall[1])


def test_water_that_runs_over_the_rim_of_a_tank_in_space_has_not_gone_through_its_wall(device):
    """What stands on the edge of a wall is beside the cell of the face below, by more than half a spacing."""
    full = spume.Case(
        spacing=0.05, dimension=3, time=spume.Time(end=0.5), preset="violent",
        domain=spume.Domain(lower=[-0.5, -0.5, -0.4], upper=[1.9, 0.9, 1.5]),
        fluid=[spume.Fluid(name="water", shape=spume.Box(lower=[0.0, 0.0, 0.0], upper=[0.45, 0.4, 0.4]))],
        body=[
            spume.Wall(name="tank", shape=spume.Tank(lower=[0.0, 0.0, 0.0], upper=[1.4, 0.4, 0.25], open=["top"]))
        ],
    )  # fmt: skip
    simulation = full.build(device=device, threads=1)
    while not simulation.done:
        simulation.advance()
    y = by_id(simulation, "position")[:, 1]
    assert np.count_nonzero(np.abs(y - 0.2) > 0.2) > 5, "some of it is on the rim or beyond"
