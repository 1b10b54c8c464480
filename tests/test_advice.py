"""What is warned of when a case is checked: nothing that is computed, but what was hardly meant."""

import logging

import numpy as np
import pytest

import spume
from spume import advice
from spume.build import initial_rows, initial_snapshot
from spume.case import built_in_cases, load
from spume.motion import Series, Sinusoid, Uniform
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


class TestCorners:
    """Walls of two bodies beside a particle, and nothing where they should meet."""

    lid = spume.Box(lower=[0.0, 0.6], upper=[1.0, 0.8])

    def test_a_lid_as_wide_as_the_room_leaves_its_corners_open(self, said):
        full = water([0.0, 0.0], [1.0, 0.6])
        (sentence,) = said(case_of(full, (TANK, spume.Wall(name="lid", shape=self.lid, layers=4))))
        assert "body.1.shape: and body 'tank' meet at a corner of the fluid with nothing in it, at (" in sentence
        assert "let one of them reach over the other by its thickness, 0.2 m" in sentence
        wider = spume.Box(lower=[-0.15, 0.6], upper=[1.15, 0.8])
        assert said(case_of(full, (TANK, spume.Wall(name="lid", shape=wider)))) == []

    def test_where_no_fluid_is_yet_nothing_is_said(self, said):
        assert said(case_of(bodies=(TANK, spume.Wall(name="lid", shape=self.lid)))) == []

    def test_along_an_edge_in_three_dimensions(self, said):
        tank = spume.Tank(lower=[0.0, 0.0, 0.0], upper=[0.4, 0.4, 0.4], open=["top"])
        fluid = spume.Fluid(name="water", shape=spume.Box(lower=[0.0, 0.0, 0.0], upper=[0.4, 0.4, 0.4]))
        for beyond, warned in ((0.0, 1), (0.15, 0)):
            lid = spume.Box(lower=[0.0, -beyond, 0.4], upper=[0.4 + beyond, 0.4 + beyond, 0.6])
            bodies = (spume.Wall(name="tank", shape=tank), spume.Wall(name="lid", shape=lid))
            assert len(said(case_of(fluid, bodies, dimension=3))) == 1, "the left edge is open either way"
            lid = spume.Box(lower=[-beyond, -beyond, 0.4], upper=[0.4 + beyond, 0.4 + beyond, 0.6])
            assert len(said(case_of(fluid, (bodies[0], spume.Wall(name="lid", shape=lid)), dimension=3))) == warned


class TestMotions:
    """What a body that moves is hardly meant to do."""

    def plate(self, motion, x=0.4, **more):
        return spume.Wall(name="plate", shape=spume.Box(lower=[x, 0.0], upper=[x + 0.15, 0.4]), motion=motion, **more)

    @pytest.mark.parametrize(
        ("velocity", "names"),
        [((0.3, 0.0), []), ((1.0, 0.0), ["tank"]), ((0.0, 1.0), []), ((0.0, -0.5), ["tank"]), ((-5.0, 0.0), ["tank"])],
    )
    def test_through_other_bodies(self, said, velocity, names):
        sentences = said(case_of(bodies=(TANK, self.plate(Uniform(velocity=velocity)))))
        assert len(sentences) == len(names)
        for name, sentence in zip(names, sentences, strict=True):
            assert f"body.1.motion: runs into body {name!r} at t = " in sentence

    def test_each_body_on_the_way_is_named_once_and_with_its_time(self, said):
        post = spume.Wall(name="post", shape=spume.Box(lower=[0.7, -0.15], upper=[0.85, 0.5]))
        first, second = said(case_of(bodies=(TANK, post, self.plate(Uniform(velocity=[1.0, 0.0])))))
        assert "runs into body 'post' at t = 0.2" in first  # 0.15 m to the face, 1.5 spacings further in
        assert "runs into body 'tank' at t = 0.5" in second

    def test_who_has_been_taken_away_meets_nobody(self, said):
        fast = Uniform(velocity=[1.0, 0.0])
        assert said(case_of(bodies=(TANK, self.plate(fast, until=0.3)))) == []
        gone = spume.Wall(name="post", shape=spume.Box(lower=[0.7, 0.0], upper=[0.85, 0.4]), until=0.1)
        assert said(case_of(bodies=(TANK, gone, self.plate(fast, until=0.45)))) == []

    def test_two_that_move_alike_or_apart_do_not_meet_but_others_do(self, said):
        left, right = Uniform(velocity=[0.2, 0.0]), Uniform(velocity=[-0.2, 0.0])
        pair = lambda a, b: (self.plate(a, 0.3), self.plate(b, 0.7).model_copy(update={"name": "other"}))  # noqa: E731
        fluid = water([0.0, 0.4], [0.2, 0.5])
        assert said(case_of(fluid, (TANK, *pair(left, left)), domain={"gravity": [0.0, 0.0]})) == []
        assert said(case_of(fluid, (TANK, *pair(right, left)), domain={"gravity": [0.0, 0.0]})) == []
        (sentence,) = said(case_of(fluid, (TANK, *pair(left, right)), domain={"gravity": [0.0, 0.0]}))
        assert "body.1.motion: runs into body 'other'" in sentence

    def test_a_flap_on_the_floor_is_as_meant(self, said):
        flap = Sinusoid(amplitude_deg=15.0, period=1.0, centre=[0.475, 0.0])
        assert said(case_of(bodies=(TANK, self.plate(flap)))) == []

    def test_a_table_in_millimetres_is_too_fast(self, said, tmp_path):
        (tmp_path / "m.csv").write_text("time,y\n0,0\n1,100\n")
        motion = Series(file=tmp_path / "m.csv", interpolation="linear")
        (sentence,) = said(case_of(bodies=(TANK, self.plate(motion))))
        assert "body.1.motion: reaches 100 m/s, where a fall over the height of the water gives 2.43 m/s" in sentence
        (sentence,) = said(case_of(domain={"motion": motion}))
        assert "domain.motion: reaches 100 m/s" in sentence
        steady = Uniform(velocity=[100.0, 0.0])
        assert (
            said(case_of(domain={"motion": steady, "frame": "tank"})) == []
        )  # a train's water does not feel its speed

    def test_longer_than_a_month(self, caplog):
        caplog.set_level(logging.WARNING, "spume")
        logging.getLogger("spume").propagate = True
        advice.warn_of_time(case_of(), 20 * 86400.0)
        assert not caplog.records
        advice.warn_of_time(case_of(), 3e9)
        assert "time.end: to t = 1 s at a spacing of 0.05 m it would run for about 3.47e+04 days" in caplog.text


@pytest.mark.parametrize(
    ("more", "warned"),
    [({}, True), ({"time_scale": 0.04}, False), ({"shift_max": 10.0}, False), ({"time_scale": 1e-3}, False)],
)
def test_a_reference_of_another_time(said, tmp_path, more, warned):
    (tmp_path / "r.csv").write_text("t,p\n10,1\n20,2\n")
    gauges = (Pressure(name="p", at=(0.0, 0.1)),)
    sentences = said(case_of(gauges=gauges, reference=[{"gauge": "p", "file": str(tmp_path / "r.csv"), **more}]))
    assert len(sentences) == warned
    assert not warned or "its instants, 10 to 20 s, lie outside of the run, 0 to 1 s" in sentences[0]


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


@pytest.mark.parametrize("beyond", [0.0, 0.1])
def test_a_body_that_ends_with_the_period_is_told_of(caplog, beyond):
    """Its end would be a wall across the boundary; one that goes on beyond it has none."""
    l0 = 0.02
    case = spume.Case(
        spacing=l0, time=spume.Time(end=1.0),
        domain=spume.Domain(periodic=["x"], lower=[0.0, -0.5], upper=[0.4, 0.5]),
        fluid=[spume.Fluid(name="water", shape=spume.Box(lower=[0.0, 0.0], upper=[0.4, 0.1]))],
        body=[spume.Wall(name="floor", shape=spume.Box(lower=[-beyond, -0.08], upper=[0.4 + beyond, 0.0]))],
    )  # fmt: skip
    with caplog.at_level("WARNING", logger="spume"):
        case.build(threads=1)
    told = [message for message in caplog.messages if "ends at the periodic boundary" in message]
    assert len(told) == (2 if beyond == 0.0 else 0)
    if told:
        assert "body.0.shape: it ends at the periodic boundary x = 0 m" in told[0]


class TestEnclosedAir:
    """Two columns that are joined below a divider, one of them under a lid."""

    @staticmethod
    def chamber(lid=True, divided=0.3, **more):
        water = [([0.0, 0.0], [0.4, 0.6]), ([0.6, 0.0], [1.0, 0.6]), ([0.4, 0.0], [0.6, 0.3])]
        bodies = [
            spume.Wall(name="tank", shape=spume.Tank(lower=[0.0, 0.0], upper=[1.0, 1.2], open=["top"])),
            spume.Wall(name="divider", shape=spume.Box(lower=[0.4, divided], upper=[0.6, 1.2])),
        ]
        if lid:
            bodies.append(spume.Wall(name="lid", shape=spume.Box(lower=[-0.15, 1.0], upper=[0.6, 1.15])))
        fluid = [
            spume.Fluid(name=f"water{k}", shape=spume.Box(lower=lower, upper=upper))
            for k, (lower, upper) in enumerate(water)
        ]
        return spume.Case(spacing=L0, time={"end": 1.0}, fluid=fluid, body=bodies, **more)

    def test_is_spoken_of(self, said):
        (sentence,) = said(self.chamber())
        assert "a void of 0.16 m^2 is enclosed from the beginning" in sentence
        assert 'air = "adiabatic"' in sentence

    @pytest.mark.parametrize("air", ["adiabatic", {"name": "adiabatic", "smallest": 3.0}])
    def test_not_where_it_is_taken_for_air(self, said, air):
        assert said(self.chamber(step={"name": "project-in-place", "air": air})) == []

    def test_not_where_it_is_open(self, said):
        assert said(self.chamber(lid=False)) == []

    def test_not_in_a_closed_tank_that_is_half_full(self, said):
        closed = spume.Wall(name="tank", shape=spume.Tank(lower=[0.0, 0.0], upper=[1.0, 0.6]))
        assert said(case_of(water([0.0, 0.0], [1.0, 0.3]), (closed,))) == []
