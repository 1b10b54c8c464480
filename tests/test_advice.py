"""What is warned of when a case is checked: nothing that is computed, but what was hardly meant."""

import logging

import numpy as np
import pytest

import spume
from spume import advice
from spume.build import initial_rows, initial_snapshot
from spume.case import built_in_cases, load
from spume.outputs.gauges import Elevation, Pressure

L0 = 0.05
TANK = spume.Wall(name="tank", shape=spume.Tank(lower=[0.0, 0.0], upper=[1.0, 0.6], open=["top"]))
BLOCK = spume.Wall(name="block", shape=spume.Box(lower=[0.5, 0.0], upper=[0.95, 0.5]))


def water(lower, upper, **more):
    return spume.Fluid(name="water", shape=spume.Box(lower=lower, upper=upper), **more)


def case_of(fluid=None, bodies=(TANK,), gauges=(), **more):
    fluids = (fluid or water([0.0, 0.0], [0.3, 0.3]),)
    return spume.Case(spacing=L0, time={"end": 1.0}, fluid=fluids, body=bodies, gauge=gauges, **more)


@pytest.fixture
def said():
    """Return what is warned of about a case."""
    heard = []

    class Ear(logging.Handler):
        def emit(self, record):
            heard.append(record.getMessage())

    log, ear = logging.getLogger("spume"), Ear()
    log.addHandler(ear)

    def said(case):
        heard.clear()
        advice.warn(case, initial_snapshot(case, initial_rows(case)))
        return list(heard)

    yield said
    log.removeHandler(ear)


@pytest.mark.parametrize(
    ("lower", "upper"), [([2.0, 0.0], [2.3, 0.3]), ([0.2, -0.9], [0.5, -0.5]), ([-0.8, 0.3], [-0.5, 0.6])]
)
def test_fluid_with_nothing_below_it_will_fall(said, lower, upper):
    (sentence,) = said(case_of(water(lower, upper)))
    assert "no body lies below fluid 'water' along gravity: it will fall, leave the region and be removed" in sentence


def test_fluid_above_a_tank_falls_into_it(said):
    assert said(case_of(water([0.2, 0.8], [0.5, 1.0]))) == []


def test_where_down_is_is_said_by_gravity(said):
    beside = water([-0.5, 0.0], [-0.3, 0.3])
    assert said(case_of(beside, domain={"gravity": [9.81, 0.0]})) == []
    assert said(case_of(beside, domain={"gravity": [0.0, 0.0]})) == []
    assert len(said(case_of(beside, domain={"gravity": [-9.81, 0.0]}))) == 1


def test_nothing_falls_along_a_period(said):
    domain = {"gravity": [1.0, 0.0], "periodic": ["x"], "lower": [0.0, -1.0], "upper": [0.3, 1.0]}
    assert said(case_of(bodies=(), domain=domain)) == []


@pytest.mark.parametrize("at", [(0.7, 0.25), (0.7, 0.4), (-0.08, 0.1), (0.2, -0.1)])
def test_a_pressure_inside_a_wall_is_none(said, at):
    (sentence,) = said(case_of(bodies=(TANK, BLOCK), gauges=(Pressure(name="p", at=at),)))
    assert "inside" in sentence
    assert "gauge 'p' will see no fluid; move it to the surface of the wall or into the fluid" in sentence


def test_a_pressure_on_a_wall_or_half_a_spacing_inside_is_one(said):
    places = [(0.0, 0.1), (0.5, 0.2), (0.7, 0.5), (-0.024, 0.1), (0.0, 0.0), (0.3, 0.3), (0.2, 0.55)]
    gauges = tuple(Pressure(name=f"p{k}", at=at) for k, at in enumerate(places))
    assert said(case_of(bodies=(TANK, BLOCK), gauges=gauges)) == []


def test_an_elevation_inside_a_wall_is_none(said):
    walls = spume.Wall(name="tank", shape=TANK.shape, layers=5)
    (sentence,) = said(case_of(bodies=(walls,), gauges=(Elevation(name="h", at=(-0.6,)),)))
    assert "has neither fluid nor a floor on its line: gauge 'h' will see no fluid" in sentence
    # Over the rim water may run.
    assert said(case_of(bodies=(walls,), gauges=(Elevation(name="h", at=(-0.08,)),))) == []
    gauges = tuple(Elevation(name=f"h{k}", at=(x,)) for k, x in enumerate((0.0, 0.2, 0.8, 1.0, 1.02)))
    assert said(case_of(gauges=gauges)) == []


def test_several_densities_are_not_validated(said):
    oil = spume.Fluid(name="oil", shape=spume.Box(lower=[0.0, 0.3], upper=[0.3, 0.5]), density=900.0)
    both = (water([0.0, 0.0], [0.3, 0.3]), oil)
    (sentence,) = said(case_of().model_copy(update={"fluid": both}))
    assert "densities of 900, 1000 kg/m^3: flows of several densities are computed but not validated yet" in sentence
    same = (both[0], oil.model_copy(update={"density": 1000.0}))
    assert said(case_of().model_copy(update={"fluid": same})) == []


@pytest.mark.parametrize("name", ["dam-break", "hydrostatic", "poiseuille", "standing-wave", "taylor-green"])
def test_built_in_cases_are_meant(said, name):
    assert name in built_in_cases()
    coarse = {"dam-break": 0.02}.get(name, 0.1)
    words = " ".join(said(load(name, [f"spacing={coarse}"])))
    assert "will fall" not in words
    assert "will see no fluid" not in words


def test_below_is_judged_along_gravity_however_it_points():
    down = np.array([0.6, 0.0, -0.8])
    floor = advice._Deepest(np.array([10.0 * down]), down, 0.1)
    assert floor.below(np.array([[0.0, 0.0, 0.0], 11.0 * down, [0.0, 1.0, 0.0]])).tolist() == [True, False, False]
