"""How fast neighbours move against each other, and fields that share memory."""

import numpy as np
import pytest

import spume
from spume.build import build
from spume.particles import Field, Particles
from spume.steps.project_in_place import ProjectInPlace


@pytest.fixture
def simulation(device):
    case = spume.Case(
        spacing=0.1, time=spume.Time(end=1.0),
        fluid=[spume.Fluid(name="water", shape=spume.Box(lower=[0.0, 0.0], upper=[0.8, 0.4]))],
        body=[spume.Wall(name="tank", shape=spume.Tank(lower=[0.0, 0.0], upper=[2.0, 1.0], open=["top", "left"]))],
    )  # fmt: skip
    simulation = build(case, device)
    simulation.step.begin(simulation.domain)
    return simulation


def relative(simulation, motion):
    particles = simulation.particles
    velocity = np.zeros((particles.count, 2))
    fluid = particles.numpy("kind") == 1
    velocity[fluid] = motion(particles.numpy("position")[fluid])
    particles.set("velocity", velocity)
    return simulation.step.relative_speed(simulation.domain)


def test_water_that_slides_along_a_wall_does_not_move_against_it(simulation):
    assert relative(simulation, lambda x: [3.0, 0.0]) == pytest.approx(0.0, abs=1e-6)


def test_water_that_falls_on_a_wall_does(simulation):
    assert relative(simulation, lambda x: [3.0, -2.0]) == pytest.approx(2.0, rel=1e-6)


def test_a_particle_among_others(simulation):
    def motion(x):
        velocity = np.tile([3.0, 0.0], (len(x), 1))
        velocity[np.argmin(np.linalg.norm(x - [0.45, 0.05], axis=1))] = [3.0, 1.5]
        return velocity

    assert relative(simulation, motion) == pytest.approx(1.5, rel=1e-6)


def test_drops_that_fly_past_each_other_count_as_much_as_they_are_surrounded(device):
    case = spume.Case(
        spacing=0.1, time=spume.Time(end=1.0),
        fluid=[
            spume.Fluid(name="low", shape=spume.Box(lower=[0.0, 0.0], upper=[0.3, 0.1])),
            spume.Fluid(name="high", shape=spume.Box(lower=[0.0, 0.1], upper=[0.3, 0.2])),
        ],
    )  # fmt: skip
    simulation = build(case, device)
    step, domain, particles = simulation.step, simulation.domain, simulation.particles
    step.begin(domain)
    velocity = np.zeros((particles.count, 2))
    velocity[particles.numpy("position")[:, 1] > 0.1] = [4.0, 0.0]
    particles.set("velocity", velocity)
    n = particles.numpy("number_density") / step.number_density.n0(domain.lattice)
    assert 0.1 < n.max() < 0.9
    x = particles.numpy("position")
    speed = [
        min(n[i], n[j]) * 4.0
        for i in range(6)
        for j in range(6)
        if np.linalg.norm(x[i] - x[j]) < step.gradient.radius(domain.lattice) and velocity[i, 0] != velocity[j, 0]
    ]
    assert step.relative_speed(domain) == pytest.approx(max(speed), rel=1e-6)
    assert particles.largest("relative_motion") == pytest.approx(16.0, rel=1e-6)


def test_scratch_of_different_owners_shares_memory(device):
    mine = (Field("a", ("d",), scratch="one"), Field("b", ("d",), scratch="one"))
    theirs = (Field("c", ("d",), scratch="two"), Field("d", (), scratch="two"))
    particles = Particles(2, 0.1, (*mine, *theirs))
    assert particles["c"] is particles["a"]
    assert particles["b"] is not particles["a"]
    assert particles["d"] is not particles["a"]
    particles.keep("a", ("recipe",), ("position",))
    assert particles.keeps("a", ("recipe",), ("position",))
    particles.written("c")
    assert not particles.keeps("a", ("recipe",), ("position",))


def test_sums_that_one_function_reads_take_no_memory_of_their_own(device):
    particles = Particles(3, 0.1, ProjectInPlace().needed_fields())
    assert particles["neighbour_spread"] is particles["correction"]
    assert particles["cg_direction"] is particles["weighted_pressure"]
    assert particles["cg_product"] is particles["fluid_weight"]
    # These outlive the function that writes them.
    own = [particles[name] for name in ("cg_residual", "predicted_gradient", "images", "shift", "slip_velocity")]
    scratch = [
        particles[name] for name, field in particles.fields.items() if field.scratch not in ("", "correction", "slip")
    ]
    assert not any(a is b for a in own for b in scratch)
