"""Prescribed motions: values, derivatives, composition, and what is refused."""

import numpy as np
import pytest

from spume.motion import Composed, Series, Sinusoid, Uniform
from spume.problems import CaseError

RNG = np.random.default_rng(1)
STEP = 1e-4
"""Of the difference quotients that analytic derivatives are compared with [s]."""


def table(tmp_path, lines, name="motion.csv"):
    path = tmp_path / name
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def smooth_table(tmp_path):
    t = np.linspace(0.0, 2.0, 81)
    rows = [f"{a:.4f},{0.1 * np.sin(2 * a):.9f},{20 * np.sin(3 * a):.9f}" for a in t]
    return table(tmp_path, ["# a motion", "time [s],x [m],angle_deg [deg]", *rows])


def motions(tmp_path, d):
    axis = None if d == 2 else (1.0, 2.0, -0.5)
    centre, along = (0.3, -0.2, 0.1)[:d], (0.1, -0.2, 0.05)[:d]
    roll = Sinusoid(amplitude=along, amplitude_deg=25.0, period=1.3, phase_deg=40.0, centre=centre, axis=axis)
    ramped = Sinusoid(amplitude_deg=30.0, frequency=0.8, ramp=1.5, centre=centre, axis=axis)
    spin = Uniform(velocity=along, rate_deg=200.0, centre=centre, axis=axis, start=0.1)
    series = Series(file=smooth_table(tmp_path), axis=axis)
    return {"sinusoid": roll, "ramp": ramped, "uniform": spin, "series": series, "composed": Composed(
        outer=roll, inner=spin)}  # fmt: skip


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("name", ["sinusoid", "ramp", "uniform", "series", "composed"])
def test_derivatives_are_those_of_the_pose(tmp_path, name, d):
    motion = motions(tmp_path, d)[name]
    points = RNG.uniform(-1.0, 1.0, (20, d))
    for t in (0.31, 0.77, 1.4):
        before, now, after = (motion.pose(t + s, d)(points) for s in (-STEP, 0.0, STEP))
        assert motion.velocity_at(points, t) == pytest.approx((after - before) / (2 * STEP), abs=1e-5)
        assert motion.acceleration_at(points, t) == pytest.approx((after - 2 * now + before) / STEP**2, abs=1e-3)


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("name", ["sinusoid", "ramp", "uniform", "series", "composed"])
def test_everything_starts_where_the_case_puts_it_and_stays_rigid(tmp_path, name, d):
    motion = motions(tmp_path, d)[name]
    points = RNG.uniform(-1.0, 1.0, (10, d))
    assert motion.pose(0.0, d)(points) == pytest.approx(points, abs=1e-12)
    pose = motion.pose(1.1, d)
    assert pose.rotation @ pose.rotation.T == pytest.approx(np.eye(d), abs=1e-12)
    assert np.linalg.det(pose.rotation) == pytest.approx(1.0)
    assert pose.origin(pose(points)) == pytest.approx(points, abs=1e-12)
    assert pose.unturned(pose.turned(points)) == pytest.approx(points, abs=1e-12)


def test_angles_count_from_x_to_y_about_the_centre():
    quarter = Uniform(rate_deg=90.0, centre=(1.0, 0.0)).pose(1.0, 2)
    assert quarter(np.array([[2.0, 0.0]])) == pytest.approx(np.array([[1.0, 1.0]]))
    about_z = Uniform(rate_deg=90.0, axis=(0.0, 0.0, 2.0)).pose(1.0, 3)
    assert about_z(np.array([[1.0, 0.0, 5.0]])) == pytest.approx(np.array([[0.0, 1.0, 5.0]]))


def test_a_ramp_starts_from_rest_without_a_jump():
    motion = Sinusoid(amplitude_deg=10.0, period=1.0, ramp=0.5)
    for order in (1, 2):
        assert motion.coordinates(0.0, order)[1] == 0.0
        early, late = (motion.coordinates(0.5 + s, order)[1] for s in (-1e-7, 1e-7))
        assert early == pytest.approx(late, abs=1e-4)
    assert motion.coordinates(0.75)[1] == pytest.approx(np.radians(-10.0))


def test_nothing_moves_before_the_start():
    motion = Uniform(velocity=(1.0, 0.0), start=0.5)
    assert motion.pose(0.5, 2).shift == pytest.approx([0.0, 0.0])
    assert motion.velocity_at(np.zeros((1, 2)), 0.4) == pytest.approx(np.zeros((1, 2)))
    assert motion.pose(0.8, 2).shift == pytest.approx([0.3, 0.0])


def test_a_spline_passes_its_points_and_follows_a_cubic(tmp_path):
    t = np.array([0.0, 0.3, 0.5, 0.9, 1.0])
    path = table(tmp_path, ["time [s],y [m]", *(f"{a!r},{float(a**3 - a)!r}" for a in t.tolist())])
    motion = Series(file=path)
    for a in (0.0, 0.13, 0.5, 0.71, 1.0):
        assert motion.pose(a, 2).shift == pytest.approx([0.0, a**3 - a], abs=1e-12)
        assert motion.coordinates(a, 2)[0] == pytest.approx([0.0, 6.0 * a], abs=1e-10)


def test_straight_lines_have_corners(tmp_path):
    path = table(tmp_path, ["time,x", "0,1", "1,2", "2,0"])
    motion = Series(file=path, interpolation="linear")
    assert motion.pose(0.5, 2).shift == pytest.approx([0.5, 0.0])
    assert motion.coordinates(1.0, 1)[0][0] == pytest.approx(-2.0)
    assert motion.pose(5.0, 2).shift == pytest.approx([-1.0, 0.0]), "the last value holds"


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (["time,x", "0,0", "1,nan", "2,0"], r"motion.csv:3: .*finite"),
        (["time,x", "0,0", "1,", "2,0"], r"motion.csv:3: .*numbers"),
        (["# note", "time,x", "0,0", "1,1", "1,2"], r"motion.csv:5: time 1 s stands after 1 s"),
        (["time,x", "0,0", "2,1", "1,2"], r"motion.csv:4: time 1 s stands after 2 s"),
        (["time,x", "0,0", "1,1", "2,1", "", "30,2", "31,2", "32,2"], r"motion.csv:6: a gap of 28 s"),
        (["time,x", "0.5,0", "1,1"], r"begins at 0.5 s"),
        (["time,x", "0,0"], r"one instant"),
        (["time,x [mm]", "0,0", "1,1"], r"'x \[mm\]' is in mm; it must be in m"),
        (["time,angle", "0,0", "1,1"], r"column 'angle'; allowed: .*did you mean 'angle_deg'"),
        (["x,time", "0,0", "1,1"], r"needed: time first"),
    ],
)  # fmt: skip
def test_bad_tables_are_named_with_their_line(tmp_path, lines, message):
    with pytest.raises(ValueError, match=message):
        Series(file=table(tmp_path, lines))


def test_a_gap_may_be_allowed(tmp_path):
    path = table(tmp_path, ["time,x", "0,0", "1,1", "2,1", "30,2"])
    assert Series(file=path, largest_gap=28.0).pose(30.0, 2).shift[0] == pytest.approx(2.0)


def test_what_contradicts_itself_is_refused():
    for wrong in ({"amplitude_deg": 3.0}, {"amplitude_deg": 3.0, "period": 1.0, "frequency": 1.0}, {"period": 1.0}):
        with pytest.raises(CaseError):
            Sinusoid(**wrong)


def test_equal_tables_are_equal(tmp_path):
    lines = ["time,x", "0,0", "1,1"]
    first, same = (Series(file=table(tmp_path, lines)) for _ in range(2))
    assert first == same
    other = Series(file=table(tmp_path, [*lines, "2,1"]))
    assert first != other
