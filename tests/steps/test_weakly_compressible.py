"""The weakly compressible step: speed of sound, rest, momentum, and a collapse beside the projection's."""

import numpy as np
import pytest

import spume
from spume.particles import FLUID, WALL
from spume.schemes.collision.none import Free
from spume.schemes.gradient.stabilised import Stabilised
from spume.steps.weakly_compressible import WeaklyCompressible
from spume.wall_models.neumann import Neumann
from spume.wall_models.resting import Resting
from tanks import advanced, by_id, column, dam_break, drop


def build(case, device):
    return case.build(device=device, threads=1, precision="double")


@pytest.mark.parametrize("exponent", [1.0, 7.0])
def test_sound_travels_at_its_speed(device, exponent):
    """A standing wave of pressure in a periodic box swings with the period L/c0, within 3 %."""
    length, l0, c0 = 1.0, 0.05, 20.0
    step = WeaklyCompressible(speed_of_sound=c0, exponent=exponent, diffusion=0.0)
    case = spume.Case(
        spacing=l0, time=spume.Time(end=1.0),
        domain=spume.Domain(periodic=["x", "y"], lower=[0.0, 0.0], upper=[length, 8 * l0], gravity=[0.0, 0.0]),
        fluid=[spume.Fluid(name="water", shape=spume.Box(lower=[0.0, 0.0], upper=[length, 8 * l0]))], step=step,
    )  # fmt: skip
    simulation = build(case, device)
    x = simulation.fetch("position")[:, 0]
    simulation.particles.set("pressure", 100.0 * np.cos(2 * np.pi * x / length))
    times, amplitudes = [], []
    while simulation.time < 1.1 * length / c0:
        simulation.advance()
        x, p = by_id(simulation, "position", "pressure")
        times.append(simulation.time - simulation.dt)  # the pressure is that of the step's start
        amplitudes.append(2.0 * np.mean(p * np.cos(2 * np.pi * x[:, 0] / length)))
    times, amplitudes = np.array(times), np.array(amplitudes)
    crossing = np.flatnonzero(np.diff(np.sign(amplitudes)))
    zeros = [np.interp(0.0, *zip(*sorted(zip(amplitudes[k : k + 2], times[k : k + 2], strict=True)), strict=True))
             for k in crossing]  # fmt: skip
    assert len(zeros) == 2
    assert 2.0 * (zeros[1] - zeros[0]) == pytest.approx(length / c0, rel=0.03)
    assert amplitudes[0] == pytest.approx(100.0, rel=1e-3)
    assert np.abs(amplitudes).max() < 102.0, "the waves do not grow"


def test_diffusion_damps_sound_and_leaves_a_linear_pressure_alone(device):
    """In a column at rest the diffusion has nothing to do; a disturbance of single rows dies out at once."""
    simulation = advanced(build(column(step=WeaklyCompressible(), initial="hydrostatic"), device), steps=2)
    rate = by_id(simulation, "density_diffusion")
    assert np.abs(rate).max() < 1e-2
    left = {}
    for diffusion in (0.0, 0.1):
        step = WeaklyCompressible(speed_of_sound=15.0, diffusion=diffusion)
        simulation = build(drop(step=step, gravity=(0.0, 0.0)), device)
        noise = np.random.default_rng(4).normal(size=simulation.particles.count)
        simulation.particles.set("pressure", 10.0 * noise)
        left[diffusion] = by_id(advanced(simulation, steps=60), "relative_density").std()
    assert left[0.1] < 0.5 * left[0.0]


def test_a_column_stays_at_rest(device):
    """Hydrostatic pressure, and c0 = 10 sqrt(g H) where none is given."""
    simulation = advanced(build(column(step=WeaklyCompressible(), initial="hydrostatic"), device), steps=200)
    x, u, p = by_id(simulation, "position", "velocity", "pressure")
    assert np.abs(p - 9810.0 * (0.5 - x[:, 1])).max() < 0.005 * 9810.0 * 0.5
    assert np.abs(u).max() < 1e-3 * np.sqrt(9.81 * 0.5)
    c0 = by_id(simulation, "speed_of_sound")
    assert c0 == pytest.approx(10.0 * np.sqrt(9.81 * 0.5))
    assert simulation.dt <= 0.25 * 0.025 / c0[0]
    assert "iterations" not in simulation.statistics


def test_momentum_is_conserved(device):
    """A disturbed drop under pressure: the pairs' forces cancel, whatever their sum does to single rows."""
    step = WeaklyCompressible(speed_of_sound=15.0, collision=Free())
    case = drop(
        step=step, gravity=(0.0, 0.0),
        fluid={"disturbance": 0.2, "initial": {"kind": "uniform", "value": [0.3, -0.1]}},
    )  # fmt: skip
    simulation = build(case, device)
    simulation.particles.set(
        "pressure", 500.0 + 300.0 * np.random.default_rng(2).normal(size=simulation.particles.count)
    )
    advanced(simulation, steps=40)
    u = by_id(simulation, "velocity")
    assert np.abs(u - [0.3, -0.1]).max() > 0.02
    assert u.mean(axis=0) == pytest.approx([0.3, -0.1], abs=1e-12)


def test_a_column_collapses_as_with_a_projection(device):
    """The front within 5 % of project-in-place before the impact; the density within a few Mach numbers squared."""
    fronts = {}
    for name, step in (("sound", WeaklyCompressible()), ("projection", None)):
        simulation = advanced(build(dam_break(step=step), device), until=0.2)
        fronts[name] = by_id(simulation, "position")[:, 0].max()
        if step is not None:
            ratio, u = by_id(simulation, "relative_density", "velocity")
            mach = np.linalg.norm(u, axis=1).max() / (10.0 * np.sqrt(9.81 * 0.2))
            assert simulation.statistics["mach"] == pytest.approx(mach)
            assert simulation.statistics["removed"] == 0
            assert np.abs(ratio - 1.0).max() < 2.0 * mach**2
    assert fronts["projection"] > 0.4
    assert fronts["sound"] == pytest.approx(fronts["projection"], rel=0.05)


def test_the_speed_of_sound_must_be_known(device):
    with pytest.raises(ValueError, match="speed_of_sound"):
        build(drop(step=WeaklyCompressible(), gravity=(0.0, 0.0)), device).advance()


def test_a_run_goes_on_when_all_fluid_has_left(device):
    """Nothing holds the drop; below the domain it is removed."""
    case = drop(l0=0.05, radius=0.1, step=WeaklyCompressible(speed_of_sound=20.0))
    case = case.model_copy(update={"domain": spume.Domain(lower=[-1.0, -0.2], upper=[1.0, 1.0], gravity=[0.0, -9.81])})
    simulation = build(case, device)
    while simulation.time < 0.35:
        simulation.advance()
    assert not simulation.snapshot().fluid.any()


@pytest.mark.parametrize("slope", [0.0, 2e4], ids=["constant", "linear"])
def test_diffusion_leaves_linear_pressures_alone_on_any_arrangement(device, slope):
    """Also with a gradient of the momentum that is not exact there."""
    step = WeaklyCompressible(speed_of_sound=20.0)
    case = drop(step=step, gravity=(0.0, 0.0), fluid={"disturbance": 0.2})
    simulation = build(case, device)
    particles = simulation.particles
    particles.set("pressure", 1000.0 + slope * particles.numpy("position")[:, 0])
    simulation.domain.pairs.update(particles)
    x = by_id(simulation, "position")
    pressure = dict(zip(*by_id(simulation, "id", "pressure"), strict=True))
    # Tait's equation gives the pressure back, so the step begins with the one that was set.
    ratio = (1.0 + particles.numpy("pressure") * 7.0 / (1000.0 * 400.0)) ** (1.0 / 7.0)
    particles.set("speed_of_sound", np.full(particles.count, 20.0))
    particles.set("relative_density", ratio)
    step(simulation.domain, 0.0, 1e-5, 1e-5)
    assert by_id(simulation, "pressure") == pytest.approx(np.array(list(pressure.values())), rel=1e-6)
    inside = np.linalg.norm(x, axis=1) < 0.13
    assert np.abs(by_id(simulation, "density_diffusion")[inside]).max() < 1e-9


def test_a_pair_that_would_end_too_near_is_kept_apart(device):
    """The stabilising force looks at where the rows will be: they have not moved when it acts."""
    l0, d = 0.02, 0.9
    step = WeaklyCompressible(speed_of_sound=20.0, gradient=Stabilised(form="consistent", alpha=d), collision=Free())
    case = drop(l0=l0, radius=1.2 * l0, step=step, gravity=(0.0, 0.0), time={"step_max": 1e-4})
    simulation = build(case, device)
    particles = simulation.particles
    particles.remove(np.arange(particles.count) >= 2)
    particles.set("position", np.array([[0.0, 0.0], [0.91 * l0, 0.0]]))
    particles.set("velocity", np.array([[2.0, 0.0], [-2.0, 0.0]]))
    for _ in range(5):
        simulation.advance()
        x = by_id(simulation, "position")
        assert np.linalg.norm(x[1] - x[0]) > (d - 0.01) * l0


def test_drops_have_the_pressure_of_the_air(device):
    """What a row with hardly a neighbour has added up is let go."""
    simulation = build(drop(l0=0.02, radius=0.024, step=WeaklyCompressible(speed_of_sound=20.0)), device)
    particles = simulation.particles
    particles.remove(np.arange(particles.count) >= 1)
    simulation.advance()
    particles.set("relative_density", np.full(particles.count, 1.5))
    simulation.advance()
    assert by_id(simulation, "relative_density") == pytest.approx(np.ones(1))


def test_a_dam_break_on_a_round_body(device):
    """Bounded by what the fall gives: no drop is thrown off."""
    water = spume.Fluid(name="water", shape=spume.Box(lower=[0.0, 0.0], upper=[0.2, 0.2]))
    tank = spume.Tank(lower=[0.0, 0.0], upper=[0.6, 0.4])
    case = spume.Case(
        spacing=0.0125, time=spume.Time(end=0.4), fluid=[water], step=WeaklyCompressible(),
        body=[
            spume.Wall(name="tank", shape=tank),
            spume.Wall(name="disk", shape=spume.Sphere(centre=[0.36, 0.07], radius=0.05)),
        ],
    )  # fmt: skip
    simulation = build(case, device)
    fastest = 0.0
    while not simulation.done:
        simulation.advance()
        fastest = max(fastest, simulation.particles.largest_norm("velocity"))
    assert fastest < 3.0 * np.sqrt(2 * 9.81 * 0.2)


def test_wall_rows_with_an_equation_diffuse_nothing(device):
    """What the field holds at their places is that of rows that were there before, and not kept by a checkpoint."""
    step = WeaklyCompressible(wall_model=Resting())
    simulation = advanced(build(dam_break(cells=(6, 8), length=14, step=step), device), steps=40)
    particles = simulation.particles
    arrays, numbers = simulation.state(())
    found = []
    for stale in (0.0, 7.0):
        simulation.restore(arrays, numbers)
        particles.set("density_diffusion", np.full(particles.count, stale))
        simulation.advance()
        found.append(by_id(simulation, "relative_density", kinds=FLUID | WALL))
    assert np.array_equal(*found)


@pytest.mark.parametrize("re", [2.1, 3.1])
def test_the_corner_of_a_tank_is_no_spray(device, re):
    step = WeaklyCompressible(wall_model=Neumann(re=re))
    case = column(cells=(8, 12), initial="hydrostatic")
    thicker = tuple(body.model_copy(update={"layers": 4}) for body in case.body)
    case = case.model_copy(update={"body": thicker, "step": step})
    simulation = advanced(build(case, device), steps=60)
    x, p = by_id(simulation, "position", "pressure")
    corner = np.argmin(np.abs(x).sum(axis=1))
    assert p[corner] == pytest.approx(9810.0 * (0.3 - x[corner, 1]), rel=0.02)
