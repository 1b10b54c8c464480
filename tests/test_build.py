"""From a case to rows: counts, checks across shapes, several bodies, periods."""

import numpy as np
import pytest

from spume.bodies import Wall
from spume.build import build, check_gauges, grid_of, initial_rows
from spume.case import Case, CaseError, Domain, Fluid, Time, built_in_cases, load
from spume.geometry import Box, Difference, Polygon, Sphere, Tank
from spume.motion import Sinusoid, Uniform
from spume.particles import DUMMY, FLUID, WALL
from spume.prediction import predict

L0 = 0.1


def case(fluid=None, body=None, **more):
    fluid = fluid or [Fluid(name="water", shape=Box(lower=(0, 0), upper=(0.6, 0.3)))]
    body = [tank()] if body is None else body
    return Case(spacing=L0, time=Time(end=1.0), fluid=fluid, body=body, **more)


def tank(**more):
    return Wall(name="tank", shape=Tank(lower=(0, 0), upper=(1.6, 0.6), open=("top",)), **more)


def complaint(a_case, function=initial_rows):
    with pytest.raises(CaseError) as caught:
        function(a_case)
    return str(caught.value)


def cells(rows, mask):
    return {tuple(c) for c in np.round(rows["position"][mask] / L0 - 0.5).astype(int)}


def test_rows_of_a_tank():
    rows = initial_rows(case())
    fluid = rows["kind"] == FLUID
    assert fluid.sum() == 18
    assert rows["position"][fluid].min() == pytest.approx(0.05)
    assert (rows["kind"] == WALL).sum() == 16 + 2 + 2 * 6 + 2 * 2, "the rim of either wall, too"
    assert np.array_equal(rows["id"], np.arange(len(rows["id"])))
    assert np.array_equal(rows["master"][fluid], rows["id"][fluid])
    assert np.all(rows["kind"][rows["master"][~fluid]] == WALL)
    assert np.all(rows["body"] == np.where(fluid, -1, 0))
    assert np.all(rows["density"] == 1000.0)
    assert not rows["to_surface"][fluid].any()
    assert rows["position"].dtype == float
    assert rows["kind"].dtype == np.int32


@pytest.mark.parametrize("name", built_in_cases())
def test_every_built_in_case_can_be_set_up(name):
    a_case = load(name)
    rows = initial_rows(a_case)
    check_gauges(a_case, rows)
    position = rows["position"]
    fluid = rows["kind"] == FLUID
    measure = sum(f.shape.measure() for f in a_case.fluid)
    assert fluid.sum() * a_case.spacing**a_case.dimension == pytest.approx(measure, rel=1e-2)  # faces snap to cells
    cell = np.round(position / a_case.spacing - 0.5, 6)
    if not any(f.disturbance for f in a_case.fluid) and name != "standing-wave":
        assert len(np.unique(cell, axis=0)) == len(cell)
    assert np.all(np.isin(rows["kind"][rows["master"][~fluid]], (WALL,)))


def test_disturbance_is_seeded_and_bounded():
    def rows(seed):
        water = Fluid(name="water", shape=Box(lower=(0, 0), upper=(0.6, 0.3)), disturbance=0.1, seed=seed)
        return initial_rows(case([water]))["position"]

    plain = initial_rows(case())["position"]
    assert np.array_equal(rows(1), rows(1))
    assert not np.array_equal(rows(1), rows(2))
    moved = np.abs(rows(1) - plain)
    assert moved.max() <= 0.1 * L0
    assert moved[:18].max() > 0.08 * L0
    assert moved[18:].max() == 0.0  # walls stay


def test_rows_are_the_same_wherever_the_case_is():
    shift = np.array([12.34, -5.67])
    there = case(
        [Fluid(name="water", shape=Box(lower=shift, upper=shift + np.array([0.6, 0.3])))],
        [Wall(name="tank", shape=Tank(lower=shift, upper=shift + np.array([1.6, 0.6]), open=("top",)))],
    )
    here, there = initial_rows(case()), initial_rows(there)
    assert there["position"] - shift == pytest.approx(here["position"], abs=1e-12)
    assert there["to_surface"] == pytest.approx(here["to_surface"], abs=1e-12)
    for name in ("kind", "master", "body"):
        assert np.array_equal(here[name], there[name])


def test_initial_fields_are_added_and_reach_wet_walls():
    water = Fluid(
        name="water",
        shape=Box(lower=(0, 0), upper=(0.6, 0.3)),
        initial=["hydrostatic", {"kind": "uniform", "value": [1, 0]}],
    )
    rows = initial_rows(case([water]))
    fluid = rows["kind"] == FLUID
    assert np.all(rows["velocity"][fluid] == [1.0, 0.0])
    assert not rows["velocity"][~fluid].any()
    expected = 9810.0 * (0.3 - rows["position"][fluid][:, 1])
    assert rows["pressure"][fluid] == pytest.approx(expected)
    floor = (np.abs(rows["position"] - [0.25, -0.05]) < 1e-9).all(axis=1)
    assert rows["pressure"][floor] == pytest.approx([9810.0 * 0.35])
    far = (np.abs(rows["position"] - [1.25, -0.05]) < 1e-9).all(axis=1)
    assert rows["pressure"][far].tolist() == [0.0]


def test_fluid_inside_a_wall_names_both():
    wide = Fluid(name="water", shape=Box(lower=(0, 0), upper=(1.8, 0.3)))
    text = complaint(case([wide]))
    assert "6 of the 54 particles of fluid 'water' lie in body 'tank', the first at (1.65, 0.05) m" in text
    rock = Wall(name="rock", shape=Sphere(centre=(0.3, 0.2), radius=0.15))
    assert "body 'rock'" in complaint(case(body=[tank(), rock]))


def test_fluid_deep_inside_a_block_is_found():
    block = Wall(name="block", shape=Box(lower=(-1, -1), upper=(1, 1)), layers=3)
    drop = Fluid(name="drop", shape=Box(lower=(-0.1, -0.1), upper=(0.1, 0.1)))
    assert "body 'block'" in complaint(case([drop], [block]))


def test_fluid_beside_a_tank_is_no_mistake():
    """Fluid of another tank far away is behind this tank's walls, but not in them."""
    other = Wall(name="other", shape=Tank(lower=(3, 0), upper=(4, 1), open=("top",)))
    fluids = [
        Fluid(name="a", shape=Box(lower=(0, 0), upper=(0.6, 0.3))),
        Fluid(name="b", shape=Box(lower=(3, 0), upper=(4, 0.5))),
    ]
    rows = initial_rows(case(fluids, [tank(), other]))
    assert set(rows["material"][rows["body"] == 1]) == {1}


def test_overlapping_fluids_are_refused():
    oil = Fluid(name="oil", shape=Box(lower=(0.5, 0), upper=(1.0, 0.3)))
    text = complaint(case([*case().fluid, oil]))
    assert "3 of the 15 particles of fluid 'oil' lie in fluid 'water', the first at (0.55, 0.05) m" in text


def test_more_rows_than_an_array_has_indices_for_are_refused(monkeypatch):
    monkeypatch.setattr("spume.kernels.LONGEST_ARRAY", 500)
    water = case([Fluid(name="a", shape=Box(lower=(0, 0), upper=(1, 1)))])
    with pytest.raises(CaseError, match=r"at most 100 fit, .* has 5 numbers a particle, at most 500: choose a"):
        build(water)


def test_a_period_of_a_few_spacings_is_refused():
    with pytest.raises(CaseError, match=r"periodic length 0\.5 m along axis 0: at least .*choose a smaller spacing"):
        build(load("couette", ["spacing=0.1"]))


def test_a_shape_too_small_for_the_spacing_is_refused():
    assert "half a spacing" in complaint(case([Fluid(name="a", shape=Box(lower=(0, 0), upper=(0.01, 1)))]))
    speck = Fluid(name="a", shape=Sphere(centre=(0.3, 0.3), radius=0.01))
    assert "no particle fits" in complaint(case([speck]))


def test_too_small_a_spacing_is_refused_before_memory_is_asked_for():
    assert "GiB" in complaint(case().model_copy(update={"spacing": 1e-9}))
    long = Wall(name="channel", shape=Tank(lower=(0, 0), upper=(1e7, 0.6), open=("top",)))
    assert "GiB" in complaint(case(body=[long]))
    needle = Polygon(vertices=((0, 0), (1000, 1000), (1000, 1000.1)))
    thin = case([Fluid(name="thin", shape=needle)], []).model_copy(update={"spacing": 0.002})
    assert "too small for fluid 'thin': it spans 2.5e+11 cells" in complaint(thin)


def test_a_face_off_the_lattice_is_said(caplog):
    odd = Wall(name="tank", shape=Tank(lower=(0, 0), upper=(1.64, 0.6), open=("top",)))
    with caplog.at_level("WARNING", logger="spume"):
        initial_rows(case(body=[odd]))
    assert "upper x = 1.64 m is no multiple of the spacing of 0.1 m: moved to 1.6 m" in caplog.text


class TestSeveralBodies:
    sill = Wall(name="sill", shape=Box(lower=(0.8, -0.3), upper=(1.1, 0.2)))

    def test_one_row_a_cell(self):
        rows = initial_rows(case(body=[tank(), self.sill]))
        solid = rows["kind"] != FLUID
        assert len(cells(rows, solid)) == solid.sum()

    def test_the_floor_under_a_block_becomes_dummies(self):
        rows = initial_rows(case(body=[tank(), self.sill]))
        wall = cells(rows, rows["kind"] == WALL)
        assert (7, -1) in wall
        assert (9, -1) not in wall
        assert {(8, 0), (8, 1), (9, 1), (10, 1), (10, 0)} <= wall
        assert (9, 0) not in wall
        assert np.all(rows["kind"][rows["master"][rows["kind"] == DUMMY]] == WALL)

    def test_order_of_bodies_decides_between_equals(self):
        for order, owner in (([tank(), self.sill], 0), ([self.sill, tank()], 1)):
            rows = initial_rows(case(body=order))
            cell = np.round(rows["position"] / L0 - 0.5).astype(int)
            (row,) = np.flatnonzero((cell == [9, -3]).all(axis=1))
            assert rows["body"][row] in (0, 1)
            (row,) = np.flatnonzero((cell == [7, -1]).all(axis=1))
            assert rows["body"][row] == owner


class TestPeriodic:
    def plates(self, width=0.5):
        shape = Tank(lower=(0, 0), upper=(width, 1.0), open=("left", "right"))
        return Case(
            spacing=L0,
            time=Time(end=1.0),
            domain=Domain(periodic=["x"], lower=[0, -1], upper=[width, 2]),
            fluid=[Fluid(name="water", shape=Box(lower=(0, 0), upper=(width, 1.0)), disturbance=0.3)],
            body=[Wall(name="plates", shape=shape)],
        )

    def test_walls_end_with_the_period_and_fluid_is_wrapped(self):
        rows = initial_rows(self.plates())
        assert (rows["kind"] == FLUID).sum() == 50
        assert (rows["kind"] == WALL).sum() == 10
        assert (rows["kind"] == DUMMY).sum() == 20
        assert rows["position"][:, 0].min() >= 0.0
        assert rows["position"][:, 0].max() < 0.5

    def test_walls_that_reach_beyond_a_period_are_cut(self):
        a_case = self.plates()
        long = Wall(name="floor", shape=Box(lower=(-2, -0.5), upper=(3, 0)))
        rows = initial_rows(a_case.model_copy(update={"body": (long,)}))
        solid = rows["kind"] != FLUID
        assert solid.sum() == 5 * 5
        assert rows["position"][solid][:, 0].min() > 0.0

    def test_fluid_beyond_the_period_is_moved_into_it(self):
        a_case = self.plates()
        shifted = Fluid(name="water", shape=Box(lower=(0.2, 0), upper=(0.7, 1.0)))
        rows = initial_rows(a_case.model_copy(update={"fluid": (shifted,)}))
        x = rows["position"][rows["kind"] == FLUID]
        assert np.unique(np.round(x[:, 0], 9)).tolist() == [0.05, 0.15, 0.25, 0.35, 0.45]
        assert len(np.unique(np.round(x, 9), axis=0)) == 50

    def test_fluids_that_meet_across_the_period_overlap(self):
        a_case = self.plates()
        left = Fluid(name="left", shape=Box(lower=(0, 0), upper=(0.3, 1.0)))
        right = Fluid(name="right", shape=Box(lower=(0.3, 0), upper=(0.6, 1.0)))
        text = complaint(a_case.model_copy(update={"fluid": (left, right)}))
        assert "10 of the 30 particles of fluid 'right' lie in fluid 'left'" in text
        long = Fluid(name="long", shape=Box(lower=(0, 0), upper=(0.6, 1.0)))
        assert "overlaps itself" in complaint(a_case.model_copy(update={"fluid": (long,)}))

    def test_the_period_is_a_whole_number_of_spacings(self):
        assert "5.5 spacings" in complaint(self.plates(0.55))

    def test_the_lattice_starts_where_the_period_does(self):
        a_case = self.plates()
        moved = Domain(periodic=["x"], lower=[-0.03, -1], upper=[0.47, 2])
        assert grid_of(a_case.model_copy(update={"domain": moved})).origin == (-0.03, 0.0)


@pytest.mark.parametrize(
    ("gauge", "words"),
    [
        ({"kind": "pressure", "name": "p", "at": [3.0, 0.1]}, "must lie in the domain"),
        ({"kind": "pressure", "name": "p", "at": [0.1, 0.1, 0.1]}, "2 numbers in 2D"),
        ({"kind": "elevation", "name": "p", "at": [5.0]}, "must lie in the domain"),
        ({"kind": "force", "name": "p", "body": "tnk"}, "tank"),
    ],
)
def test_gauges_that_do_not_fit(gauge, words):
    a_case = case(gauge=[gauge])
    rows = initial_rows(a_case)
    assert words in complaint(a_case, lambda c: check_gauges(c, rows))


def test_references_that_do_not_fit():
    gauge = {"kind": "elevation", "name": "level", "at": [0.5]}
    for key, value, words in (
        ("column", "x", "one of"),
        ("value", "elevatio", "did you mean 'elevation'?"),
    ):
        reference = {"gauge": "level", "file": "dam-break/level-1.csv", key: value}
        a_case = case(gauge=[gauge], reference=[reference])
        rows = initial_rows(a_case)
        assert words in complaint(a_case, lambda c: check_gauges(c, rows))  # noqa: B023


def test_a_case_without_walls_and_any_shape():
    shape = Polygon(vertices=((0, 0), (1, 0), (0.5, 1)))
    rows = initial_rows(case([Fluid(name="drop", shape=shape)], []))
    assert len(rows["kind"]) * L0**2 == pytest.approx(0.5, rel=0.1)


def test_a_room_that_is_taken_for_a_solid():
    room = Wall(name="room", shape=Box(lower=(-0.1, -0.1), upper=(1.0, 0.6)))
    hint = """; if its shape is the room that holds the water, say wetted = "inside\""""
    assert complaint(case(body=[room])).endswith(
        f"18 of the 18 particles of fluid 'water' lie in body 'room', the first at (0.05, 0.05) m{hint}"
    )
    block = Wall(name="block", shape=Box(lower=(0.3, 0), upper=(0.6, 0.6)))
    assert "wetted" not in complaint(case(body=[tank(), block]))
    assert initial_rows(case(body=[room.model_copy(update={"wetted": "inside"})]))


def test_prediction_grows_with_the_case():
    a_case = load("dam-break")
    few = predict(a_case, initial_rows(a_case), 2)
    finer = load("dam-break", ["spacing=0.0025"])
    many = predict(finer, initial_rows(finer), 2)
    assert many.fluid == 4 * few.fluid
    assert many.steps == pytest.approx(2 * few.steps, rel=0.02)
    assert many.seconds > 6 * (few.seconds - 10.0)
    assert many.bytes > few.bytes


def test_prediction_knows_the_speed_of_motions():
    rate = lambda a_case: predict(a_case, initial_rows(a_case), 1).steps * 0.5 * L0  # noqa: E731, speed where the end is 1 s
    gate = Wall(name="gate", shape=Box(lower=(0.6, 0), upper=(0.9, 0.6)), motion=Uniform(velocity=(0, 1000.0)))
    at_rest = rate(case())
    assert at_rest == pytest.approx(np.sqrt(2 * 9.81 * 0.3), rel=0.03)
    assert rate(case(body=[tank(), gate])) == pytest.approx(1000.0)
    assert rate(case(body=[tank(), gate.model_copy(update={"until": 0.25})])) == pytest.approx(250.0, rel=0.02)
    assert rate(case(domain=Domain(motion=Uniform(velocity=(1000.0, 0.0))))) == pytest.approx(1000.0)
    quick = Sinusoid(amplitude=(10.0, 0.0), period=0.1)  # 628 m/s, and the tank's water begins with it
    in_tank = rate(case(domain=Domain(motion=quick, frame="tank")))
    assert in_tank == pytest.approx(628.0, rel=0.02), "the mean of 1 - cos"


def test_prediction_on_a_card_is_what_was_measured():
    a_case = load("dam-break", ["spacing=0.0025", "device='cuda'"])
    predicted = predict(a_case, initial_rows(a_case), 2)
    assert (predicted.seconds - 30.0) / predicted.steps == pytest.approx(0.012 + 1.3e-8 * predicted.fluid)


def test_prediction_with_threads_follows_what_they_share():
    a_case = load("dam-break")
    rows = initial_rows(a_case)
    one, two, all_there_are = (predict(a_case, rows, threads).seconds - 10.0 for threads in (1, 2, 10_000))
    whatever = 1e-3 * predict(a_case, rows, 1).steps
    assert (one - whatever) / (two - whatever) == pytest.approx(1.7, rel=0.01)
    assert 0.1 * one < all_there_are < 0.5 * one


def test_a_domain_that_ends_inside_a_wall_is_refused():
    box = {"lower": [0.0, 0.0], "upper": [0.3, 0.5]}
    case = Case(
        spacing=0.02, time=Time(end=1.0), domain=Domain(**box),
        fluid=[Fluid(name="water", shape=Box(lower=[0.0, 0.0], upper=[0.3, 0.2]))],
        body=[Wall(name="tank", shape=Tank(**box, open=["top"]))],
    )  # fmt: skip
    with pytest.raises(CaseError, match=r"domain.lower: and upper leave out 213 of 363 rows, of tank"):
        build(case)


class TestFluidsOnEachOther:
    """A hydrostatic pressure carries what stands on the fluid."""

    def layers(self, upper=None, lower="hydrostatic", **more):
        upper = upper or {"lower": (0.0, 0.3), "upper": (0.6, 0.5)}
        oil = Fluid(name="oil", shape=Box(**upper), density=850.0, **more)
        return [Fluid(name="water", shape=Box(lower=(0, 0), upper=(0.6, 0.3)), initial=lower), oil]

    def pressure(self, fluids, **more):
        rows = initial_rows(case(fluids, **more))
        return rows, rows["position"], rows["pressure"], rows["kind"] == FLUID

    @pytest.mark.parametrize("upper", ["rest", "hydrostatic"])
    def test_layers_are_exact_also_in_the_walls(self, upper):
        rows, x, p, fluid = self.pressure(self.layers(initial=upper))
        water = rows["material"] == 0
        exact = 9.81 * np.where(x[:, 1] < 0.3, 850.0 * 0.2 + 1000.0 * (0.3 - x[:, 1]), 850.0 * (0.5 - x[:, 1]))
        assert p[fluid & water] == pytest.approx(exact[fluid & water], rel=1e-12)
        wall = ~fluid & water & (p > 0.0)
        assert p[wall] == pytest.approx(exact[wall], rel=1e-12)
        assert {tuple(c) for c in np.round(x[wall] / L0 - 0.5).astype(int)} >= {(0, -1), (-1, 0), (-1, 2)}
        assert (p[fluid & ~water] > 0.0).all() == (upper == "hydrostatic")

    def test_what_does_not_stand_on_it_does_not_weigh_on_it(self):
        alone = self.pressure(self.layers()[:1])
        for box in ({"lower": (0.6, 0.0), "upper": (0.9, 0.6)}, {"lower": (0.0, 0.4), "upper": (0.6, 0.6)}):
            _, _, p, fluid = self.pressure(self.layers(box))
            assert np.array_equal(p[fluid][:18], alone[2][alone[3]])
        _, x, p, _ = self.pressure(self.layers({"lower": (0.0, 0.3), "upper": (0.2, 0.5)}))
        assert p[:18] == pytest.approx(9.81 * (1000.0 * (0.3 - x[:18, 1]) + 170.0 * (x[:18, 0] < 0.2)))

    def test_one_fluid_between_two_parts_of_another(self):
        layer = Box(lower=(0.0, 0.1), upper=(0.6, 0.2))
        whole = Difference(of=Box(lower=(0, 0), upper=(0.6, 0.3)), without=[layer])
        fluids = [
            Fluid(name="water", shape=whole, initial="hydrostatic"),
            Fluid(name="oil", shape=layer, density=850.0),
        ]
        rows, x, p, fluid = self.pressure(fluids)
        water = fluid & (rows["material"] == 0)
        exact = 9.81 * (1000.0 * (0.3 - x[:, 1]) - 15.0 * (x[:, 1] < 0.1))
        assert p[water] == pytest.approx(exact[water], rel=1e-12)

    def test_a_surface_that_is_given_says_all(self):
        given = {"kind": "hydrostatic", "surface": 0.47}
        _, x, p, _ = self.pressure(self.layers(lower=given))
        assert p[:18] == pytest.approx(9810.0 * (0.47 - x[:18, 1]), rel=1e-12)

    def test_up_is_against_gravity(self):
        right = [
            Fluid(name="water", shape=Box(lower=(0.3, 0.0), upper=(0.6, 0.6)), initial="hydrostatic"),
            Fluid(name="oil", shape=Box(lower=(0.0, 0.0), upper=(0.3, 0.6)), density=850.0),
        ]
        _, x, p, _ = self.pressure(right, domain=Domain(gravity=(2.0, 0.0)))
        assert p[:18] == pytest.approx(2.0 * (255.0 + 1000.0 * (x[:18, 0] - 0.3)), rel=1e-12)

    def test_a_column_does_not_go_round_a_period(self):
        domain = Domain(periodic=["y"], lower=(0.0, 0.0), upper=(0.6, 0.6))
        fluids = self.layers({"lower": (0.0, 0.3), "upper": (0.6, 0.6)})
        _, x, p, _ = self.pressure(fluids, body=[], domain=domain)
        assert p[:18] == pytest.approx(9.81 * (255.0 + 1000.0 * (0.3 - x[:18, 1])), rel=1e-12)
