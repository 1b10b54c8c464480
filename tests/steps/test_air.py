"""Enclosed air: a slug of water between two of them oscillates as the gas law says."""

import math

import numpy as np
import pytest

import spume
from spume.outputs import OutputSettings, summary
from spume.outputs.gauges.force import Force
from spume.outputs.gauges.pressure import Pressure
from spume.particles import FLUID
from spume.problems import CaseError
from spume.schemes.air.adiabatic import Adiabatic
from spume.schemes.free_surface.blended import Blended
from spume.schemes.gradient.corrected import Corrected
from spume.steps.project_in_place import ProjectInPlace

OUTSIDE, GAMMA = 1000.0, 1.4
AIR, SLUG, HEIGHT, SPEED = 0.1, 0.2, 0.1, 0.02
PERIOD = 2.0 * math.pi / math.sqrt(GAMMA * OUTSIDE / (1000.0 * SLUG * AIR))


def slug(l0=0.01, end=2.0, **air):
    """Return the case of a slug of water that moves towards air at the closed end of a tube, without gravity."""
    end_of = {"left": ([-4 * l0, 0.0], [0.0, HEIGHT]), "right": ([0.6, 0.0], [0.6 + 4 * l0, HEIGHT])}
    return spume.Case(
        spacing=l0, time=spume.Time(end=end * PERIOD),
        domain=spume.Domain(gravity=[0.0, 0.0], lower=[-0.1, 0.0], upper=[0.7, HEIGHT], periodic=["y"]),
        fluid=[
            spume.Fluid(
                name="water", shape=spume.Box(lower=[AIR, 0.0], upper=[AIR + SLUG, HEIGHT]),
                initial={"kind": "uniform", "value": [-SPEED, 0.0]},
            )
        ],
        body=[spume.Wall(name=n, shape=spume.Box(lower=lower, upper=upper)) for n, (lower, upper) in end_of.items()],
        step=ProjectInPlace(air=Adiabatic(pressure=OUTSIDE, exponent=GAMMA, **air)),
    )  # fmt: skip


@pytest.fixture(scope="module")
def motion():
    """Times, how far the slug has come, pressure of the air, and what gauges say of it."""
    simulation = slug().build(threads=1)
    gauges = {"pressure": Pressure(name="end", at=(0.0, 0.05)), "force_x": Force(name="force", body="left")}
    rows = []
    while not simulation.done:
        simulation.advance()
        particles, snapshot = simulation.particles, simulation.snapshot()
        x = particles.numpy("position")[particles.numpy("kind") == FLUID, 0].mean() - AIR - SLUG / 2
        # As a gauge with an interval sees it: what it does not say that it reads is not there.
        felt = [g.measure(snapshot.keep(g.read_of(snapshot.fields)))[column] for column, g in gauges.items()]
        rows.append((simulation.time, x, simulation.statistics["air_pressure"], *felt))
    return np.array(rows).T


def test_period_and_amplitude(motion):
    t, x = motion[:2]
    crossing = np.flatnonzero(x[:-1] * x[1:] < 0)
    instants = t[crossing] - x[crossing] * (t[crossing + 1] - t[crossing]) / (x[crossing + 1] - x[crossing])
    assert instants[2] - instants[0] == pytest.approx(PERIOD, rel=0.004)
    amplitude = SPEED * PERIOD / (2.0 * math.pi)
    assert x.max() == pytest.approx(amplitude, rel=0.12)  # the first step starts with the velocity of its start
    assert x[t > PERIOD].max() == pytest.approx(x[t < PERIOD].max(), rel=0.01)


def test_the_gas_law(motion):
    x, pressure = motion[1:3]
    before = np.concatenate([[0.0], x[:-1]])  # a step takes the air where it starts
    assert pressure == pytest.approx(OUTSIDE * ((1.0 + before / AIR) ** -GAMMA - 1.0), abs=0.02 * OUTSIDE * SPEED)


def test_gauges_feel_it_where_no_water_is(motion):
    _, _, pressure, sensor, force = motion
    assert sensor == pytest.approx(pressure)
    assert force == pytest.approx(-pressure * HEIGHT)


def test_steps_resolve_the_period():
    simulation = slug(end=0.3).build(threads=1)
    simulation.advance()
    assert simulation.clock.limiter != "step"
    while not simulation.done:
        simulation.advance()
    radius = math.sqrt(AIR * HEIGHT / math.pi)
    assert simulation.dt < 0.1 * 2.0 * math.pi * radius * math.sqrt(1000.0 / (2 * GAMMA * OUTSIDE)) * 1.2


def test_the_log_tells_voids_and_pressure(tmp_path):
    case = slug(end=0.3).model_copy(update={"output": OutputSettings(pictures=False, log_interval=2)})
    case.run(tmp_path / "run", threads=1)
    (header, *lines) = (tmp_path / "run" / "log.csv").read_text(encoding="utf-8").splitlines()
    columns = header.split(",")
    assert {"air_pockets [1]", "air_pressure [Pa]"} <= set(columns)
    rows = [dict(zip(columns, line.split(","), strict=True)) for line in lines]
    assert {row["air_pockets [1]"] for row in rows[1:]} == {"1"}  # at each line, not summed up between them
    assert "air_pockets" not in summary.read(tmp_path / "run")["counts"]


def test_smaller_voids_are_empty():
    simulation = slug(end=0.3, smallest=10.5).build(threads=1)
    while not simulation.done:
        simulation.advance()
    assert simulation.statistics["air_pockets"] == 0
    assert simulation.particles.numpy("air_pressure").max() == 0.0


def test_a_bubble_carries_the_water_above():
    """A round void closed by still water is compressed until it bears the weight, and swings about that.

    It rises meanwhile, so that in the mean it bears less than what its centre has above it, and more than its top.
    """
    l0, depth = 0.01, 0.15
    water = spume.Difference(
        of=spume.Box(lower=[0.0, 0.0], upper=[0.4, 0.3]), without=[spume.Sphere(centre=[0.2, depth], radius=0.05)]
    )
    case = spume.Case(
        spacing=l0, time=spume.Time(end=0.031), step=ProjectInPlace(air=Adiabatic()),
        fluid=[spume.Fluid(name="water", shape=water)],
        body=[spume.Wall(name="tank", shape=spume.Tank(lower=[0.0, 0.0], upper=[0.4, 0.4], open=["top"]))],
    )  # fmt: skip
    simulation = case.build(threads=1)
    weighed = time = 0.0
    while not simulation.done:
        simulation.advance()
        weighed += simulation.statistics["air_pressure"] * simulation.dt
        time += simulation.dt
        assert simulation.statistics["air_pockets"] == 1
    assert 0.1 < weighed / time / 9810.0 < 0.15
    assert simulation.statistics["air_pressure"] < 0.1 * 9810.0 * depth  # one swing is over


@pytest.mark.parametrize("carried", [-1.0, 0.0, 0.3, 5.0])
def test_a_volume_that_cannot_be_carried_is_measured_anew(carried, monkeypatch):
    simulation = slug(end=0.1).build(threads=1)
    simulation.advance()
    domain, air = simulation.domain, simulation.step.air
    (number,) = domain.voids.air
    monkeypatch.setattr(type(domain.voids), "carried", lambda self, now: {number: carried * AIR * HEIGHT})
    air(domain.lattice, domain.particles, domain.voids, domain.pairs.periods)
    ((_, volume),) = domain.voids.air.values()
    assert volume == pytest.approx(AIR * HEIGHT, rel=0.05)


@pytest.mark.parametrize("other", [{"free_surface": Blended()}, {"gradient": Corrected()}])
def test_refuses_what_has_no_images(other):
    with pytest.raises(CaseError, match="choose imaged for both"):
        ProjectInPlace(air=Adiabatic(), **other)
