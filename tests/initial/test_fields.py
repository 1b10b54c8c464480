"""Initial fields against their formulas."""

import math

import numpy as np
import pytest

from spume.initial import Hydrostatic, Rest, Rotation, StandingWave, Strain, Table, TaylorGreen, Uniform
from spume.initial.base import Setting
from spume.problems import CaseError

G = 9.81
SETTING = Setting(1000.0, np.array([0.0, -G]), np.array([0.0, 0.0]), np.array([2.0, 1.0]))


def lattice(nx=40, ny=20, l0=0.05):
    i, j = np.meshgrid(np.arange(nx), np.arange(ny), indexing="ij")
    return np.stack([(i + 0.5) * l0, (j + 0.5) * l0], axis=-1).reshape(-1, 2)


def derivative(field, x, axis, h=1e-6):
    step = h * np.eye(2)[axis]
    return (field(x + step) - field(x - step)) / (2 * h)


def test_rest_and_uniform():
    x = lattice()
    assert not Rest().velocity(x, SETTING).any()
    assert np.all(Uniform(value=(1.0, 2.0)).velocity(x, SETTING) == [1.0, 2.0])


def test_rotation_is_about_its_centre_and_counter_clockwise():
    u = Rotation(rate=2.0, centre=(1.0, 0.0)).velocity(np.array([[2.0, 0.0], [1.0, 0.0], [1.0, 3.0]]), SETTING)
    assert u.tolist() == [[0.0, 2.0], [0.0, 0.0], [-6.0, 0.0]]
    u = Rotation(rate=2.0).velocity(np.array([[1.0, 0.0, 7.0]]), SETTING)
    assert u.tolist() == [[0.0, 2.0, 0.0]]


def test_strain_is_free_of_divergence():
    u = Strain(rate=3.0).velocity(np.array([[1.0, 2.0]]), SETTING)
    assert u.tolist() == [[-3.0, 6.0]]


def test_taylor_green_solves_the_momentum_equation():
    """Steady Euler equations, (u.grad) u + grad p / rho = 0, and no divergence."""
    field = TaylorGreen(speed=1.5, wavelength=0.7)
    x = np.random.default_rng(0).uniform(-1, 1, (200, 2))
    velocity = lambda y: field.velocity(y, SETTING)  # noqa: E731
    pressure = lambda y: field.pressure(y, SETTING)  # noqa: E731
    u, ux, uy = velocity(x), derivative(velocity, x, 0), derivative(velocity, x, 1)
    assert ux[:, 0] + uy[:, 1] == pytest.approx(0.0, abs=1e-6)
    convection = u[:, :1] * ux + u[:, 1:] * uy
    gradient = np.stack([derivative(pressure, x, 0), derivative(pressure, x, 1)], axis=1) / 1000.0
    assert convection + gradient == pytest.approx(0.0, abs=1e-5)


def test_hydrostatic_pressure():
    x = np.array([[0.3, 0.25], [0.3, 1.0], [0.3, 1.5]])
    assert Hydrostatic().pressure(x, SETTING) == pytest.approx([7357.5, 0.0, 0.0])
    assert Hydrostatic(surface=0.5).pressure(x, SETTING) == pytest.approx([2452.5, 0.0, 0.0])
    sideways = Setting(1000.0, np.array([2.0, 0.0]), SETTING.lower, SETTING.upper)
    assert Hydrostatic().pressure(x, sideways) == pytest.approx([600.0] * 3)
    weightless = Setting(1000.0, np.zeros(2), SETTING.lower, SETTING.upper)
    assert Hydrostatic().pressure(x, weightless).tolist() == [0.0] * 3


class TestStandingWave:
    wave = StandingWave(amplitude=0.1, wavelength=2.0)

    def test_surface_is_the_cosine(self):
        top = np.stack([np.linspace(0, 2, 50), np.ones(50)], axis=1)
        moved = self.wave.displaced(top, SETTING)
        assert moved[:, 1] == pytest.approx(1.0 + 0.1 * np.cos(math.pi * moved[:, 0]))
        assert moved[[0, -1], 0] == pytest.approx([0.0, 2.0])  # the walls stay

    def test_every_cell_keeps_its_area(self):
        x = np.random.default_rng(0).uniform([0.05, 0.05], [1.95, 0.95], (100, 2))
        moved = lambda y: self.wave.displaced(y, SETTING)  # noqa: E731
        dx, dy = derivative(moved, x, 0), derivative(moved, x, 1)
        assert dx[:, 0] * dy[:, 1] - dx[:, 1] * dy[:, 0] == pytest.approx(1.0, abs=1e-7)

    def test_too_high_a_wave_is_refused(self):
        with pytest.raises(ValueError, match="less than the depth"):
            StandingWave(amplitude=1.0, wavelength=2.0).displaced(lattice(), SETTING)


class TestTable:
    def write(self, tmp_path, text):
        path = tmp_path / "field.csv"
        path.write_text(text)
        return path

    def test_linear_fields_are_exact(self, tmp_path):
        corners = [(0, 0), (2, 0), (0, 1), (2, 1), (1, 0.5)]
        lines = [f"{x},{y},{1 + 2 * x - y},{3 * y},{5 * x}" for x, y in corners]
        table = Table(file=self.write(tmp_path, "# a comment\nx [m],y [m],u [m/s],v [m/s],p [Pa]\n" + "\n".join(lines)))
        x = lattice()
        assert table.velocity(x, SETTING)[:, 0] == pytest.approx(1 + 2 * x[:, 0] - x[:, 1])
        assert table.velocity(x, SETTING)[:, 1] == pytest.approx(3 * x[:, 1])
        assert table.pressure(x, SETTING) == pytest.approx(5 * x[:, 0])

    def test_a_profile_along_one_axis(self, tmp_path):
        table = Table(file=self.write(tmp_path, "x,y,u\n0,0,0\n0,0.5,1\n0,1,0\n"))
        u = table.velocity(np.array([[9.0, 0.25], [0.0, 2.0]]), SETTING)
        assert u.tolist() == [[0.5, 0.0], [0.0, 0.0]]

    @pytest.mark.parametrize(
        ("text", "words"),
        [
            ("", "no numbers"),
            ("x,y,u\n", "no numbers"),
            ("x,u\n0,1\n", "allowed: x, y"),
            ("x,y,q\n0,1,2\n", "allowed: x, y"),
            ("x,y\n0,1\n", "no column of values"),
            ("x,y,u\n0,1,fast\n", ":2: 0,1,fast"),
            ("x,y,u\n0,1,nan\n", "finite"),
            ("x,y,u\n0,1\n", "2 numbers under 3"),
            ("x,y,u\n0,1,1\n0,1,2\n", "twice"),
        ],
    )
    def test_bad_tables_are_refused(self, tmp_path, text, words):
        with pytest.raises(CaseError, match=words):
            Table(file=self.write(tmp_path, text))
