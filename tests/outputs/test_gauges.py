import numpy as np
import pytest

from outputs.fake_run import DENSITY, GRAVITY, N0, snapshot_of, tank
from spume.outputs.connected import components
from spume.outputs.gauges import Elevation, Energy, Force, Front, Momentum, Pressure, Velocity, Volume
from spume.problems import CaseError

L0 = 0.05


def still(width=None, jitter=0.0, depth=0.5, spacing=L0):
    return tank(spacing, 1.0, depth, 1.0, width, jitter)


def add_fluid(rows, positions, **values):
    """The rows with more fluid rows."""
    positions = np.atleast_2d(positions)
    n = len(positions)
    fluid = np.flatnonzero(rows["kind"] == 1)[:1].repeat(n)
    new = {name: np.concatenate([v, v[fluid]]) for name, v in rows.items()}
    new["position"][-n:] = positions
    new["id"] = np.arange(len(new["id"]))
    for name, value in values.items():
        new[name][-n:] = value
    return new


def at(values, width):
    """A point of the tank, with the middle of its width put in."""
    return tuple(values) if width is None else (values[0], width / 2, values[1])


# ------------------------------------------------------------------------------------------ pressure


@pytest.mark.parametrize("width", [None, 0.3])
@pytest.mark.parametrize("jitter", [0.0, 0.2])
@pytest.mark.parametrize("face", [None, 0.08])
@pytest.mark.parametrize("point", [(1.0, 0.2), (0.0, 0.12), (0.43, 0.0), (0.51, 0.27)])
def test_linear_pressure_is_measured_exactly(width, jitter, face, point):
    rows = still(width, jitter)
    d = rows["position"].shape[1]
    slope = np.array([700.0, -300.0, 400.0])[:d]
    rows["pressure"] = 5000.0 + rows["position"] @ slope
    x = at(point, width)
    normal = None if point[0] in (0.0, 1.0) or point[1] == 0.0 else (1.0,) + (0.0,) * (d - 1)
    gauge = Pressure(name="p", at=x, face=face, normal=normal)
    snapshot = snapshot_of(rows, L0)
    gauge.check(snapshot)
    assert gauge.measure(snapshot)["pressure"] == pytest.approx(5000.0 + np.dot(slope, x), rel=1e-10)


def test_a_pressure_face_averages_over_its_length_or_the_spacing():
    rows = still()
    rows["pressure"] = 1e5 * rows["position"][:, 1] ** 2
    snapshot = snapshot_of(rows, L0)
    point, wide, tiny, one = (
        Pressure(name="p", at=(1.0, 0.25), face=f).measure(snapshot)["pressure"] for f in (None, 0.3, 0.001, L0)
    )
    assert wide - point == pytest.approx(1e5 * 0.3**2 / 12.0, rel=0.1)  # mean of y² over a length
    assert tiny == one


def test_a_face_is_not_averaged_into_the_wall_below():
    rows = still()
    rows["pressure"] = np.where(rows["position"][:, 1] < 0.0, 1e9, 1000.0)  # what lies behind the floor
    rows["kind"] = np.where(rows["position"][:, 1] < 0.0, 4, rows["kind"])
    gauge = Pressure(name="p", at=(1.0, 0.01), face=L0)
    points = gauge._points(snapshot_of(rows, L0))
    assert len(points) == 4
    assert points[:, 1].min() > -1e-9
    assert gauge.measure(snapshot_of(rows, L0))["pressure"] == pytest.approx(1000.0)


def test_pressure_is_zero_where_no_fluid_is_near():
    rows = still()
    rows["pressure"][:] = 1000.0  # dry wall rows would say 1000
    snapshot = snapshot_of(rows, L0)
    assert Pressure(name="p", at=(1.0, 0.9)).measure(snapshot)["pressure"] == 0.0
    assert Pressure(name="p", at=(1.0, 0.5 + 1.6 * L0)).measure(snapshot)["pressure"] == 0.0
    assert Pressure(name="p", at=(1.0, 0.4)).measure(snapshot)["pressure"] == pytest.approx(1000.0)


def test_pressure_leaves_dry_wall_rows_out():
    rows = still()
    dry = rows["position"][:, 1] > 0.5 + L0
    rows["pressure"] = np.where(dry, 1e9, rows["pressure"])
    assert Pressure(name="p", at=(1.0, 0.5)).measure(snapshot_of(rows, L0))["pressure"] < 0.1 * DENSITY * GRAVITY


def test_pressure_at_a_jet_is_within_what_the_rows_carry():
    rows = still(depth=0.05)  # a single layer
    rows = add_fluid(rows, [[0.975, 0.07]], pressure=300.0)
    measured = Pressure(name="p", at=(1.0, 0.08)).measure(snapshot_of(rows, L0))["pressure"]
    assert 0.0 <= measured <= rows["pressure"].max()


# ------------------------------------------------------------------------------- surface and front


@pytest.mark.parametrize("width", [None, 0.3])
@pytest.mark.parametrize("x", [0.5, 0.0, 0.02, 0.96, 1.0])
def test_elevation_is_half_a_spacing_above_the_top_centres(width, x):
    rows = still(width)
    place = (x,) if width is None else (x, 0.15)
    answer = Elevation(name="h", at=place).measure(snapshot_of(rows, L0))
    for column in ("elevation", "first_surface", "wetted_length"):
        assert answer[column] == pytest.approx(0.5, abs=0.03 * L0), column


@pytest.mark.parametrize("x", [0.0, 0.5, 1.0, 2.0, 4.3])
@pytest.mark.parametrize("beside_wall", [0.45, 0.5, 0.55])
@pytest.mark.parametrize("stretch", [0.9, 1.0, 1.1])
def test_elevation_of_a_stretched_arrangement_beside_a_wall(stretch, beside_wall, x):
    """Columns apart by the stretch, rows by its inverse; the first column nearer to the wall or further away."""
    rows = tank(L0, 20 * L0, 12 * L0, 20 * L0)
    fluid = rows["kind"] == 1
    index = rows["position"][fluid] / L0 - 0.5
    rows["position"][fluid] = L0 * np.stack([beside_wall + stretch * index[:, 0], (index[:, 1] + 0.5) / stretch], -1)
    top = Elevation(name="h", at=(x * L0,)).measure(snapshot_of(rows, L0))["elevation"]
    assert top == pytest.approx(12 / stretch * L0, abs=0.006 * L0)


@pytest.mark.parametrize("stretch", [0.95, 1.0, 1.05])
def test_elevation_at_a_wall_to_which_the_topmost_row_has_come(stretch):
    """As under the crest of a standing wave, by 0.08 l0: that is no height."""
    rows = tank(L0, 20 * L0, 12 * L0, 20 * L0)
    fluid = rows["kind"] == 1
    index = rows["position"][fluid] / L0 - 0.5
    place = np.stack([0.53 + stretch * index[:, 0], (index[:, 1] + 0.5) / stretch], -1)
    place[(np.round(index[:, 1]) == 11) & (np.round(index[:, 0]) == 0), 0] -= 0.08
    rows["position"][fluid] = L0 * place
    top = Elevation(name="h", at=(0.0,)).measure(snapshot_of(rows, L0))["elevation"]
    assert top == pytest.approx(12 / stretch * L0, abs=0.035 * L0)


@pytest.mark.parametrize("layers", [1, 2, 3])
def test_elevation_of_a_thin_layer_over_a_floor(layers):
    answer = Elevation(name="h", at=(0.5,)).measure(snapshot_of(still(depth=layers * L0), L0))
    assert answer["elevation"] == pytest.approx(layers * L0, abs=0.03 * L0)
    assert answer["wetted_length"] == pytest.approx(layers * L0, abs=0.06 * L0)


def test_elevation_of_a_dry_floor_is_the_floor():
    answer = Elevation(name="h", at=(0.5,)).measure(snapshot_of(still(depth=0.0), L0))
    assert answer == {c: pytest.approx(0.0, abs=0.03 * L0) for c in answer}


def test_elevation_ignores_drops_and_shows_overturning():
    rows = still(depth=0.2)
    calm = Elevation(name="h", at=(0.5,)).measure(snapshot_of(rows, L0))
    drop = add_fluid(rows, [[0.5, 0.7]])
    assert Elevation(name="h", at=(0.5,)).measure(snapshot_of(drop, L0)) == pytest.approx(calm)
    splash = add_fluid(rows, [[0.5, 0.7], [0.53, 0.72], [0.47, 0.71]])
    seen = Elevation(name="h", at=(0.5,)).measure(snapshot_of(splash, L0))
    assert seen["elevation"] == pytest.approx(calm["elevation"])
    # A jet five rows thick that hangs over the water, connected to it at the left wall.
    i, j = np.meshgrid(np.arange(20), np.arange(5))
    jet = np.column_stack([(i.ravel() + 0.5) * L0, 0.5 + (j.ravel() + 0.5) * L0])
    column = np.column_stack([np.full(6, 0.5 * L0), 0.2 + (np.arange(6) + 0.5) * L0])
    answer = Elevation(name="h", at=(0.5,)).measure(snapshot_of(add_fluid(rows, np.vstack([jet, column])), L0))
    assert answer["first_surface"] == pytest.approx(0.2, abs=0.05 * L0)
    assert answer["elevation"] == pytest.approx(0.75, abs=0.05 * L0)
    assert answer["wetted_length"] == pytest.approx(0.45, abs=0.1 * L0)


def test_elevation_follows_the_water_smoothly():
    rows = still()
    fluid = rows["kind"] == 1
    heights = []
    for lift in (0.0, 0.25, 0.5, 0.75, 1.0):
        moved = rows | {"position": rows["position"] + np.outer(fluid, [0.0, lift * L0])}
        heights.append(Elevation(name="h", at=(0.5,)).measure(snapshot_of(moved, L0))["elevation"])
    np.testing.assert_allclose(np.diff(heights), 0.25 * L0, rtol=0.05)


def test_front_is_half_a_spacing_ahead_and_ignores_what_flies_ahead():
    rows = tank(L0, 2.0, 0.5, 1.0)
    keep = (rows["kind"] != 1) | (rows["position"][:, 0] < 0.6)
    rows = {name: v[keep] for name, v in rows.items()}
    assert Front(name="x").measure(snapshot_of(rows, L0))["front"] == pytest.approx(0.6)
    back = Front(name="x", direction=(-2.0, 0.0)).measure(snapshot_of(rows, L0))["front"]
    assert back == pytest.approx(0.0)
    flying = add_fluid(rows, [[0.9, 0.3]])
    assert Front(name="x").measure(snapshot_of(flying, L0))["front"] == pytest.approx(0.6)
    touching = add_fluid(rows, [[0.64, 0.3]])
    assert Front(name="x").measure(snapshot_of(touching, L0))["front"] == pytest.approx(0.64 + L0 / 2)


@pytest.mark.parametrize("d", [2, 3])
def test_components_against_a_search_over_all_pairs(d):
    rng = np.random.default_rng(5)
    for points in (rng.uniform(0.0, 6.0, (40, d)), rng.uniform(-1e4, 1e4, (30, d))):
        cells = np.floor(points).astype(int)
        touch = np.abs(cells[:, None] - cells[None]).max(axis=2) <= 1
        reach = np.linalg.matrix_power(touch.astype(float), 64) > 0
        label = components(points, 0.8)  # of cells of size 1
        assert np.array_equal(label[:, None] == label[None, :], reach)
        counts = np.bincount(label)
        assert np.all(np.diff(counts) <= 0)  # the largest is number 0


def test_a_lattice_stretched_by_a_wave_is_one_body():
    x, y = np.meshgrid(np.arange(30) * 1.2, np.arange(20) / 1.2)
    assert np.all(components(np.stack([x.ravel(), y.ravel()], axis=1), 1.0) == 0)


# -------------------------------------------------------------------------------- force and budgets


@pytest.mark.parametrize("width", [None, 0.3])
def test_force_of_water_at_rest_is_its_weight(width):
    rows = still(width)
    answer = Force(name="f", body="tank").measure(snapshot_of(rows, L0))
    weight = DENSITY * GRAVITY * 0.5 * 1.0 * (width or 1.0)
    up = "force_y" if width is None else "force_z"
    assert answer[up] == pytest.approx(-weight, rel=1e-9)
    assert answer["force_x"] == pytest.approx(0.0, abs=1e-9 * weight)
    middle = (0.5, 0.0) if width is None else (0.5, 0.15, 0.0)
    moments = Force(name="f", body="tank", origin=middle).measure(snapshot_of(rows, L0))
    for name, value in moments.items():
        if name.startswith("moment"):
            assert value == pytest.approx(0.0, abs=1e-9 * weight), name
    # About the left edge the weight turns clockwise.
    turning = answer["moment_z"] if width is None else -answer["moment_y"]
    assert turning == pytest.approx(-0.5 * weight, rel=1e-9)


def test_force_counts_wet_rows_only():
    rows = still()
    rows["pressure"] = np.where(rows["position"][:, 1] > 0.5 + 2 * L0, 1e9, rows["pressure"])
    rows["pressure"] = np.where(rows["position"][:, 0] > 0.5, rows["pressure"], np.minimum(rows["pressure"], 1e5))
    answer = Force(name="f", body="tank").measure(snapshot_of(rows, L0))
    assert abs(answer["force_x"]) < 1e3


@pytest.mark.parametrize("width", [None, 0.3])
def test_energy_momentum_and_volume(width):
    rows = still(width)
    d = rows["position"].shape[1]
    u = np.array([3.0, 0.0, 4.0] if d == 3 else [3.0, 4.0])
    fluid = rows["kind"] == 1
    rows["velocity"] = np.where(fluid[:, None], u, 1e6)  # walls do not count
    volume = 0.5 * (width or 1.0)
    mass = DENSITY * volume
    snapshot = snapshot_of(rows, L0)
    energy = Energy(name="e").measure(snapshot)
    assert energy["kinetic"] == pytest.approx(0.5 * mass * 25.0)
    assert energy["potential"] == pytest.approx(mass * GRAVITY * 0.25)
    assert energy["total"] == pytest.approx(energy["kinetic"] + energy["potential"])
    assert list(Momentum(name="m").measure(snapshot).values()) == pytest.approx(list(mass * u))
    assert Volume(name="v").measure(snapshot)["volume"] == pytest.approx(volume)
    surface = rows["free_surface"] == 1
    rows["number_density"] = np.where(surface, 0.3 * N0, 1.02 * N0)
    squeezed = Volume(name="v").measure(snapshot_of(rows, L0))["volume"]
    share = surface.sum() / fluid.sum()
    assert squeezed == pytest.approx(volume * (share + (1.0 - share) / 1.02))


# ----------------------------------------------------------------------------------------- mistakes


@pytest.mark.parametrize(
    ("gauge", "message"),
    [
        (Pressure(name="p", at=(1.0, 0.1, 0.2)), "gauge 'p': at = .*: 2 numbers in 2D"),
        (Pressure(name="p", at=(0.5, 0.3), face=0.01), "gives the face its normal"),
        (Elevation(name="h", at=(1.0, 0.1)), "gauge 'h': at = .*: 1 number in 2D"),
        (Force(name="f", body="ship"), "body = 'ship': one of 'tank'"),
        (Front(name="x", direction=(0.0, 0.0)), "not the zero vector"),
    ],
)
def test_a_gauge_that_does_not_fit_says_why(gauge, message):
    with pytest.raises(ValueError, match=message):
        gauge.check(snapshot_of(still(), L0))


def test_a_name_is_a_file_name():
    with pytest.raises(CaseError):
        Volume(name="a/b")


def test_columns_are_what_is_measured():
    for width in (None, 0.3):
        snapshot = snapshot_of(still(width), L0)
        place = (0.5,) if width is None else (0.5, 0.1)
        for gauge in (
            Pressure(name="g", at=at((1.0, 0.2), width)),
            Elevation(name="g", at=place),
            Front(name="g"),
            Force(name="g", body="tank"),
            Energy(name="g"),
            Momentum(name="g"),
            Volume(name="g"),
        ):
            kept = snapshot.keep(gauge.read_of(snapshot.fields))  # what it declares is all that it reads
            assert list(gauge.measure(kept)) == list(gauge.columns(snapshot.dimension))


@pytest.mark.parametrize("frame", ["laboratory", "tank"])
def test_the_force_on_an_accelerated_tank_is_that_on_its_water(frame):
    """F = m (g - a), closed and full, so that nothing can move inside."""
    import spume
    from spume.motion import Sinusoid
    from spume.steps.project_in_place import ProjectInPlace

    a, l0, size = 3.0, 0.025, (0.3, 0.2)
    omega = 2.0 * np.pi / 10.0  # a slow sine from its turning point: x = a t^2/2
    motion = Sinusoid(amplitude=[a / omega**2, 0.0], period=10.0, phase_deg=-90.0)
    case = spume.Case(
        spacing=l0, time=spume.Time(end=0.1), step=ProjectInPlace(), domain=spume.Domain(frame=frame, motion=motion),
        fluid=[spume.Fluid(name="water", shape=spume.Box(lower=[0.0, 0.0], upper=size), initial="hydrostatic")],
        body=[spume.Wall(name="tank", shape=spume.Tank(lower=[0.0, 0.0], upper=size))],
    )  # fmt: skip
    simulation = case.build(threads=1)
    while simulation.time < 0.05:
        simulation.advance()
    force = Force(name="f", body="tank").measure(simulation.snapshot())
    mass = 1000.0 * size[0] * size[1]
    assert force["force_x"] == pytest.approx(-mass * a, rel=0.01)
    assert force["force_y"] == pytest.approx(-mass * 9.81, rel=0.01)
    resumed = case.build(threads=1)
    resumed.restore(*simulation.state(Force.reads))
    assert Force(name="f", body="tank").measure(resumed.snapshot()) == force, "what a gauge reads is kept"


def test_gauges_look_through_a_periodic_boundary():
    rows = still()
    water = rows["kind"] == 1
    keep = water | ((rows["position"][:, 1] < 0.0) & (rows["position"][:, 0] > 0.0) & (rows["position"][:, 0] < 1.0))
    rows = {name: values[keep] for name, values in rows.items()} | {"id": np.arange(int(keep.sum()))}
    snapshot = snapshot_of(rows, L0)
    snapshot.periods = {0: 1.0}
    middle = Elevation(name="e", at=(0.5,)).measure(snapshot)
    for x in (0.0, 0.001, 0.999):
        assert Elevation(name="e", at=(x,)).measure(snapshot) == pytest.approx(middle, abs=1e-5)
    inside = Pressure(name="p", at=(0.5, 0.25)).measure(snapshot)["pressure"]
    for x in (0.0, 0.999):
        assert Pressure(name="p", at=(x, 0.25)).measure(snapshot)["pressure"] == pytest.approx(inside, rel=1e-9)
    with pytest.raises(ValueError, match="x, where the domain is periodic"):
        Front(name="f").check(snapshot)
    Front(name="f", direction=(0.0, 1.0)).check(snapshot)


def test_a_body_of_fluid_goes_on_behind_a_periodic_boundary():
    x = (np.stack(np.meshgrid(np.arange(40), np.arange(5)), -1).reshape(-1, 2) + 0.5) * L0
    apart = np.abs(x[:, 0] - 20 * L0) > 4 * L0
    assert components(x[apart], L0).max() == 1
    assert components(x[apart], L0, {0: 40 * L0}).max() == 0
    assert components(x[apart], L0, {0: 44 * L0}).max() == 1, "four spacings are missing there"


def test_a_line_that_no_surface_crosses_is_refused():
    snapshot = snapshot_of(still(), L0)
    Elevation(name="e", at=(0.5,)).check(snapshot)
    snapshot.gravity = np.array([9.81, 0.0])
    with pytest.raises(ValueError, match="does not point down"):
        Elevation(name="e", at=(0.5,)).check(snapshot)


def test_energy_in_a_central_gravity():
    rows = still()
    snapshot = snapshot_of(rows, L0)
    snapshot.gravity, snapshot.stiffness, snapshot.focus = np.zeros(2), 3.0, np.array([0.2, 0.1])
    r = rows["position"][rows["kind"] == 1] - snapshot.focus
    expected = 0.5 * 3.0 * DENSITY * L0**2 * (r**2).sum()
    assert Energy(name="e").measure(snapshot)["potential"] == pytest.approx(expected, rel=1e-12)


# -------------------------------------------------------------------------------- velocity, parts of the volume


@pytest.mark.parametrize("width", [None, 0.3])
@pytest.mark.parametrize("jitter", [0.0, 0.2])
@pytest.mark.parametrize("point", [(0.97, 0.2), (0.43, 0.02), (0.51, 0.27)])
def test_linear_velocity_is_measured_exactly(width, jitter, point):
    rows = still(width, jitter)
    d = rows["position"].shape[1]
    slope = np.random.default_rng(1).normal(size=(d, d))
    fluid = (rows["kind"] == 1)[:, None]
    rows["velocity"] = np.where(fluid, rows["position"] @ slope.T + np.arange(1, d + 1), 1e6)  # walls take no part
    x = at(point, width)
    gauge = Velocity(name="u", at=x)
    snapshot = snapshot_of(rows, L0)
    gauge.check(snapshot)
    found = gauge.measure(snapshot)
    expected = slope @ np.array(x) + np.arange(1, d + 1)
    assert list(found) == list(gauge.columns(d))
    assert [found[f"velocity_{a}"] for a in "xyz"[:d]] == pytest.approx(expected, rel=1e-9)
    assert found["speed"] == pytest.approx(np.linalg.norm(expected), rel=1e-9)


def test_where_no_fluid_is_there_is_no_velocity():
    snapshot = snapshot_of(still(), L0)
    assert all(np.isnan(v) for v in Velocity(name="u", at=(0.5, 0.7)).measure(snapshot).values())
    assert "inside a wall" in Velocity(name="u", at=(0.5, -0.12)).blind(snapshot)
    assert Velocity(name="u", at=(0.5, 0.1)).blind(snapshot) == ""
    with pytest.raises(ValueError, match="2 numbers in 2D"):
        Velocity(name="u", at=(0.5, 0.1, 0.2)).check(snapshot)


@pytest.mark.parametrize("width", [None, 0.3])
def test_volume_in_a_box(width):
    """Boxes that share the water share its volume."""
    rows = still(width)
    snapshot = snapshot_of(rows, L0)
    whole = Volume(name="v").measure(snapshot)["volume"]
    left = Volume(name="v", upper=at((0.3, 2.0), width) if width is None else (0.3, 1.0, 2.0))
    right = Volume(name="v", lower=at((0.3, -1.0), width) if width is None else (0.3, -1.0, -1.0))
    parts = [gauge.measure(snapshot)["volume"] for gauge in (left, right)]
    assert parts[0] == pytest.approx(0.3 * whole)
    assert sum(parts) == pytest.approx(whole)
    above = Volume(name="v", lower=(-9.0,) * (1 if width is None else 2) + (0.6,))
    assert above.measure(snapshot)["volume"] == 0.0


def test_a_box_without_inside():
    snapshot = snapshot_of(still(), L0)
    with pytest.raises(ValueError, match="lower must be less"):
        Volume(name="v", lower=(0.0, 0.5), upper=(1.0, 0.5)).check(snapshot)
    with pytest.raises(ValueError, match=r"lower = \[0.0\]: 2 numbers in 2D"):
        Volume(name="v", lower=(0.0,)).check(snapshot)
