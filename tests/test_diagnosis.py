"""Each way in which a run goes wrong, provoked: it stops and names step, particle, cause and remedy."""

import logging

import numpy as np
import pytest

import spume
import spume.run
from spume.diagnosis import FAST_STEPS, WINDOW, Diverged
from spume.outputs import checkpoint, summary, vtkhdf
from spume.particles import FLUID
from spume.pressure.conjugate_gradient import ConjugateGradient
from spume.run import run
from spume.steps.project_in_place import ProjectInPlace
from tanks import dam_break
from test_resume import assert_same, at_step, case_of


@pytest.fixture
def simulation():
    made = dam_break().build(threads=1)
    made.advance()
    return made


@pytest.fixture
def told():
    """The warnings of the logger ``spume``."""
    messages = []
    handler = logging.Handler()
    handler.emit = lambda record: messages.append(record.getMessage())
    log = logging.getLogger("spume")
    log.addHandler(handler)
    yield messages
    log.removeHandler(handler)


def count(messages, text):
    return sum(text in message for message in messages)


def give(simulation, name, ids, values):
    """Set a field of the particles with these numbers."""
    field = simulation.fetch(name)
    field[np.isin(simulation.fetch("id"), ids)] = values
    simulation.particles.set(name, field)


def failure(simulation):
    with pytest.raises(Diverged) as caught:
        simulation.advance()
    text, details = str(caught.value), caught.value.details
    assert {"step", "time", "particle", "position", "reason", "cause", "remedy"} <= set(details)
    assert all(part in text for part in (f"step {details['step']}", "Likely cause: ", "Remedy: "))
    assert f"particle {details['particle']} at (" in text
    return details


def test_a_velocity_that_is_not_a_number(simulation):
    give(simulation, "velocity", 7, np.nan)
    found = failure(simulation)
    assert (found["particle"], found["step"]) == (7, 2)
    assert found["reason"] == "a velocity is not a number"


def test_a_solve_that_fails_shows_the_worst_row():
    solver = ConjugateGradient(tolerance=1e-13, largest_iterations=2)
    simulation = dam_break(step=ProjectInPlace(solver=solver)).build(threads=1)
    found = failure(simulation)
    assert "the pressure solver failed" in found["reason"]
    assert "step.solver.tolerance" in found["remedy"]
    residual = np.abs(simulation.fetch("cg_residual"))
    assert found["particle"] == simulation.fetch("id")[np.argmax(residual)]
    # What is shown afterwards is the state that the step left, under its own number.
    assert simulation.snapshot().step == 1 == simulation.step_index + 1
    assert simulation.snapshot().time > simulation.time


def test_speeds_beyond_reason(simulation):
    for _ in range(FAST_STEPS - 1):  # a row may be thrown out of an impact
        give(simulation, "velocity", 12, [300.0, 0.0])
        simulation.advance()
    give(simulation, "velocity", 12, [300.0, 0.0])
    found = failure(simulation)
    assert found["particle"] == 12
    assert "a speed of 300 m/s" in found["reason"]


def test_what_a_fall_can_give_is_within_reason(simulation):
    for _ in range(2 * FAST_STEPS):
        give(simulation, "velocity", 12, [0.0, -8.0])
        simulation.advance()


def test_a_time_step_that_collapses(simulation):
    give(simulation, "velocity", 30, [2.0e6, 0.0])
    found = failure(simulation)
    assert found["particle"] == 30
    assert "the time step collapsed" in found["reason"]
    assert "limited by travel" in found["reason"]


def test_particles_through_a_wall(simulation):
    while simulation.step_index < 9:
        simulation.advance()
    give(simulation, "position", [3, 4, 5], [[0.24, -0.02], [0.28, -0.02], [0.32, -0.02]])
    give(simulation, "velocity", [3, 4, 5], 0.0)
    found = failure(simulation)
    assert found["particle"] in (3, 4, 5)
    assert found["reason"].startswith("3 of 100 fluid particles went through a wall")
    assert found["position"][1] < -0.01


def test_no_wall_is_said_to_leak_where_fluid_lies_in_a_corner_or_on_an_edge(simulation, told):
    while simulation.step_index < 9:
        simulation.advance()
    # In both corners of the tank, on the floor, and just above the rim of its wall.
    corners = [[0.005, 0.005], [0.595, 0.005], [0.3, 0.004], [0.61, 0.312]]
    give(simulation, "position", [3, 4, 5, 6], corners)
    give(simulation, "velocity", [3, 4, 5, 6], 0.0)
    simulation.watch._clock.step = 10
    assert simulation.watch.after_step({}) is None
    assert count(told, "behind a wall") == 0


def test_a_list_of_neighbours_that_overflows():
    simulation = dam_break(cells=(20, 25), length=40).build(threads=1)
    x = simulation.fetch("position")
    fluid = simulation.fetch("kind") == FLUID
    x[fluid] = 0.21 + 0.001 * np.random.default_rng(1).random((fluid.sum(), 2))
    simulation.particles.set("position", x)
    found = failure(simulation)
    assert "the list of neighbours overflowed" in found["reason"]
    assert found["position"] == pytest.approx([0.2105, 0.2105], abs=1e-3)


def test_limiters_that_act_too_often_are_told_of_once(simulation, told):
    watch = simulation.watch
    watch._steps, watch._uses = 0, {}  # the window begins here
    for _ in range(3 * WINDOW):
        watch.after_step({"collisions": 10, "clipped": 0, "fallbacks": 0, "removed": 0})
    assert count(told, "collisions act on 10% of the fluid particles a step") == 1
    fluid = simulation.fetch("id")[simulation.fetch("kind") == FLUID]
    give(simulation, "free_surface", fluid, 0)
    give(simulation, "free_surface", fluid[:20], 1)
    for _ in range(WINDOW):
        watch.after_step({"clipped": 60, "fallbacks": 1})
    assert count(told, "75% of the pressures inside the fluid were negative") == 1  # 60 of 100, 20 on the surface
    assert count(told, "the pressure solver needed its fallback in 100%") == 1
    watch._fluid = 1000
    for _ in range(12):
        watch.after_step({"removed": 1})
    assert count(told, "left the region") == 2  # the first one, and the first percent


def test_limiters_that_act_as_usual_are_not_told_of(simulation, told):
    for _ in range(3 * WINDOW):
        simulation.watch.after_step({"collisions": 1.0, "clipped": 0.5, "fallbacks": 0})
    assert told == []


def test_one_per_cent_of_clipped_pressures_is_of_the_rows_inside(simulation, told):
    """0.6 of 100 rows a step are too many where only 50 are off the surface; and the remedy is named."""
    fluid = simulation.fetch("id")[simulation.fetch("kind") == FLUID]
    give(simulation, "free_surface", fluid, 0)
    give(simulation, "free_surface", fluid[:50], 1)
    for _ in range(2 * WINDOW):
        simulation.watch.after_step({"clipped": 0.6})
    assert count(told, "1% of the pressures inside the fluid were negative and set to zero") == 1
    assert count(told, "set step.negative_pressure = true with a gradient that bears tension") == 1


def test_a_run_that_fails_leaves_its_state_and_a_good_checkpoint(monkeypatch, tmp_path):
    case = case_of(end=0.04, checkpoint_interval=600.0, interval=0.03)
    run(case, tmp_path / "whole")
    simulations = [case.build(threads=1)]
    with monkeypatch.context() as patch:
        patch.setattr(spume.run, "build", lambda *_: simulations[0])
        at_step(patch, 3, lambda: give(simulations[0], "velocity", 7, np.nan))
        with pytest.raises(Diverged, match="particle 7 at"):
            run(case, tmp_path / "run")
    said = summary.read(tmp_path / "run")
    assert said["status"] == "failed"
    assert said["failure"]["particle"] == 7
    assert said["reason"].startswith("step 4, t = ")
    last = vtkhdf.read(tmp_path / "run" / "run.vtkhdf")
    assert np.isnan(last["velocity"][7]).all()
    assert np.isfinite(np.delete(last["velocity"], 7, axis=0)).all()
    assert checkpoint.read(tmp_path / "run").step == 0
    spume.resume(tmp_path / "run")  # the last good state goes on, and the frame of the failed one is gone
    assert_same(tmp_path / "whole", tmp_path / "run")


def test_water_beside_a_tip_of_a_wall_has_not_gone_through_it():
    """Where a wall is one row thick that row's surface may be on its other side."""
    spike = spume.Polygon(vertices=[[0.1, -0.06], [0.2, -0.06], [0.2, 0.0], [0.15, 0.2], [0.1, 0.0]])
    water = spume.Difference(of=spume.Box(lower=[0.0, 0.0], upper=[0.3, 0.2]), without=[spike])
    case = spume.Case(
        spacing=0.02, time=spume.Time(end=0.1),
        fluid=[spume.Fluid(name="water", shape=water, initial="hydrostatic")],
        body=[
            spume.Wall(name="spike", shape=spike),
            spume.Wall(name="tank", shape=spume.Tank(lower=[0.0, 0.0], upper=[0.3, 0.3], open=["top"])),
        ],
    )  # fmt: skip
    simulation = case.build(threads=1)
    while not simulation.done:
        simulation.advance()
    assert simulation.particles.largest_norm("velocity", FLUID) < 0.1
