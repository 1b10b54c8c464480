"""Pictures of gauges: every unit has its axis, and no line hides another."""

import matplotlib.pyplot as plt
import numpy as np
import pytest

from spume.outputs import pictures
from spume.outputs.plots import plot_gauge, told_apart

TIME = np.linspace(0.0, 1.0, 101)


def axes_of(tmp_path, header, *columns):
    """Draw a gauge with these columns; return the axes of the figure."""
    file = tmp_path / "load.csv"
    np.savetxt(file, np.column_stack([TIME, *columns]), delimiter=",", header=f"time [s],{header}", comments="")
    made = []

    def figure(width, height, dpi):
        made.append(pictures.new_figure(width, height, dpi))
        return made[0]

    plot_gauge(tmp_path / "load.png", file, figure)
    return made[0].axes


def test_forces_and_moments_have_an_axis_each(tmp_path):
    wave = np.sin(6.0 * TIME)
    forces, moments = axes_of(tmp_path, "force_x [N],force_y [N],moment_z [N m]", 100.0 * wave, 50.0 + wave, wave)
    assert [line.get_label() for line in forces.lines] == ["force x", "force y"]
    assert forces.get_ylabel() == "force [N]"
    assert moments.get_ylabel() == "moment z [N m]"
    assert moments.lines[0].get_ydata() == pytest.approx(wave)
    assert forces.get_position().y0 > moments.get_position().y1
    assert (forces.get_xlabel(), moments.get_xlabel()) == ("", "t [s]")


def test_long_numbers_leave_room_for_the_label(tmp_path):
    """The picture is wider by what the numbers are longer, and nothing reaches its edge."""
    width = []
    for force in (5.0, -456789.0):
        axes_of(tmp_path, "force_x [N],force_y [N]", force * TIME, 1e5 * TIME)
        pixels = plt.imread(tmp_path / "load.png")[..., :3]
        assert (pixels[:, [0, -1]] == 1.0).all()
        width.append(pixels.shape[1])
    assert width[1] > width[0]


def test_a_gauge_of_one_unit_has_one_axis(tmp_path):
    (axes,) = axes_of(tmp_path, "volume [m^2]", TIME)
    assert (axes.get_ylabel(), axes.get_xlabel(), axes.get_legend()) == ("volume [m^2]", "t [s]", None)


def test_series_that_coincide_are_one_line_that_names_them():
    level = 0.3 + 0.05 * np.sin(6.0 * TIME)
    lines = told_apart({"elevation": level, "first_surface": level + 1e-5, "wetted_length": level})
    assert [(label, dash) for label, _, dash in lines] == [("elevation, first surface, wetted length", "-")]
    nowhere = np.full(101, np.nan)
    assert len(told_apart({"elevation": nowhere, "first_surface": nowhere})) == 1


def test_a_line_along_another_is_dashed_and_one_across_it_is_not():
    level = 0.3 + 0.05 * np.sin(6.0 * TIME)
    broken = np.where(TIME > 0.5, level - 0.02, level)
    lines = told_apart({"elevation": level, "first_surface": broken, "across": 0.6 - level})
    assert [label for label, _, _ in lines] == ["elevation", "first surface", "across"]
    assert [dash == "-" for _, _, dash in lines] == [True, False, True]
    third = np.where(TIME > 0.7, broken + 0.01, broken)
    dashes = [dash for _, _, dash in told_apart({"a": level, "b": broken, "c": third})]
    assert len({str(dash) for dash in dashes}) == 3
