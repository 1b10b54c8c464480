"""Metric functions on states that are known: exact ones have no error, wrong ones have the error that was put in."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from spume.validation.cases import (
    cavity,
    dam_break,
    elliptical_drop,
    hydrostatic,
    rotating_square,
    sloshing,
    taylor_green,
)
from spume.validation.study import mean_over_time, rms_over_time


class Known:
    """The folder of a run whose frames and gauges are given."""

    def __init__(self, frames=(), gauges=None, viscosity=0.01, end=1.0, log=None, summary=None):
        self._frames, self._gauges = frames, gauges or {}
        fluid = [SimpleNamespace(viscosity=viscosity, density=1000.0)]
        self.case = SimpleNamespace(fluid=fluid, time=SimpleNamespace(end=end), spacing=0.1)
        self.log = log or {"particles_fluid": np.array([4.0, 4.0])}
        self.summary = summary or {}

    def frames(self):
        return iter(self._frames)

    def last(self):
        return self._frames[-1]

    def gauge(self, name):
        return self._gauges[name]


class Frame(SimpleNamespace):
    def __getitem__(self, name):
        return self.arrays[name]


def frame(time, spacing, **arrays):
    return Frame(time=time, spacing=spacing, dimension=2, arrays=arrays)


def lattice(n, l0):
    return l0 * (np.stack(np.meshgrid(np.arange(n), np.arange(n)), -1).reshape(-1, 2) + 0.5)


def test_taylor_green_error_is_relative_to_the_decayed_field():
    x = lattice(20, 0.05)
    kx, ky = (2 * math.pi * x).T
    start = np.stack([-np.cos(kx) * np.sin(ky), np.sin(kx) * np.cos(ky)], 1)
    exact = start * math.exp(-8 * math.pi**2 * 0.01 * 2.0)
    for factor, error in ((1.0, 0.0), (1.1, 0.1)):
        frames = [frame(t, 0.05, position=x, velocity=u) for t, u in ((0.0, start), (2.0, factor * exact))]
        found = taylor_green.measure(Known(frames)).metrics
        assert found[taylor_green.ERROR] == pytest.approx(error, abs=1e-9)
        assert found[taylor_green.ENERGY] == pytest.approx(factor**2 - 1.0)


def test_water_at_rest_has_no_error_and_a_raised_pressure_has():
    l0 = 0.1
    x = lattice(10, l0) * np.array([0.5, 1.0])  # 0.5 m wide, half as far apart
    x = x[(np.arange(100) % 10) % 2 == 0]
    p = 9810.0 * (1.0 - x[:, 1])
    rest = np.zeros_like(x)
    for excess, error in ((0.0, 0.0), (98.1, 0.01)):
        frames = [
            frame(
                t / math.sqrt(9.81), l0, position=x, velocity=rest, pressure=p + excess, number_density=np.full(50, n)
            )
            for t, n in ((0.0, 1.0), (11.0, 1.0), (50.0, 1.02))
        ]
        found = hydrostatic.measure(Known(frames), 0.5).metrics
        assert found[hydrostatic.PRESSURE] == pytest.approx(error, abs=1e-9)
        assert found[hydrostatic.VOLUME] == pytest.approx(1.0 - 1.0 / 1.02)
        assert found[hydrostatic.KINETIC] == 0.0


def test_voids_are_holes_inside_and_no_places_outside():
    x = lattice(20, 0.1)
    assert rotating_square._voids(x, 0.1) == 0
    hole = np.linalg.norm(x - 1.0, axis=1) > 0.28
    assert rotating_square._voids(x[hole], 0.1) > 0


def test_axes_of_a_drop_count_from_the_outermost_centre():
    frames = [frame(t, 0.1, position=np.array([[0.0, y], [0.0, -y]])) for t, y in ((0.0, 0.95), (1.0, 1.45))]
    assert elliptical_drop.semi_axis(Known(frames))[1] == pytest.approx([1.0, 1.5])


def test_the_cavity_reads_both_middle_lines():
    x = lattice(40, 1 / 40)
    linear = np.stack([x[:, 1], 0.0 * x[:, 0]], 1)  # Couette flow, which meets floor and lid
    place = np.array([0.1, 0.5, 0.9])
    assert cavity._on_line(frame(1.0, 1 / 40, position=x, velocity=linear), place, 0) == pytest.approx(place, abs=1e-6)
    assert cavity._on_line(frame(1.0, 1 / 40, position=x, velocity=linear), place, 1) == pytest.approx(0.0, abs=1e-12)
    places, values = cavity.ghia("v", 400)
    assert 0.9063 not in places
    assert len(places) == len(values) == 14


def test_peaks_of_sloshing_are_single_values_near_the_impacts():
    t = np.arange(0.0, 8.3, 0.001)
    p = np.zeros_like(t)
    for k, instant in enumerate(sloshing.IMPACTS):
        p[np.searchsorted(t, instant)] = 1000.0 * (k + 1)
    found = sloshing.measure(Known(gauges={"left": {"time": t, "pressure": p}})).metrics
    assert [found[f"peak {k} [Pa]"] for k in range(1, 5)] == [1000.0, 2000.0, 3000.0, 4000.0]
    assert found["peak 1, mean over 10 ms [Pa]"] < 200.0
    assert found[sloshing.TIME] == pytest.approx(0.0, abs=1e-3)
    short = sloshing.measure(Known(gauges={"left": {"time": t[t < 3.0], "pressure": p[t < 3.0]}})).metrics
    assert "peak 2 [Pa]" not in short
    assert sloshing.TIME not in short


def test_rms_over_time_does_not_depend_on_where_the_points_lie():
    """x - 1 against 0 from 0 to 3 has the mean square 1 and the mean 1/2, however its points are distributed."""
    for t in (np.array([0.0, 3.0]), np.array([0.0, 0.1, 0.2, 0.3, 3.0]), np.linspace(-1.0, 5.0, 70)):
        series, nothing = (t, t - 1.0), (np.array([-2.0, 0.7, 9.0]), np.zeros(3))
        assert rms_over_time(series, nothing, (0.0, 3.0)) == pytest.approx(1.0, rel=1e-12)
        assert mean_over_time(series, nothing, (0.0, 3.0)) == pytest.approx(0.5, rel=1e-12)
    short = (t[t < 2.0], np.full((t < 2.0).sum(), 2.0))
    assert rms_over_time(short, nothing, (0.0, 3.0)) == pytest.approx(2.0), "as far as it goes"
    assert math.isnan(rms_over_time((t[t < 0.0], t[t < 0.0]), nothing, (0.0, 3.0))), "it does not come so far"


def test_the_dam_break_reports_what_the_case_compared(monkeypatch):
    monkeypatch.delenv("SPUME_REFERENCE_DATA", raising=False)
    entry = {"rms": 0.2, "peak": 1.9, "shift": 0.05, "arrival": 2.4}
    comparison = [{"gauge": f"pressure-{k}", **entry} for k in range(1, 5)] + [{"gauge": "level-1", "rms": 0.03}]
    gauges = {f"pressure-{k}": {"time": np.arange(3.0), "pressure": np.zeros(3)} for k in range(1, 5)}
    found = dam_break.measure(Known(gauges=gauges, summary={"comparison": comparison}))
    assert found.metrics[f"{dam_break.PRESSURES[3]}, at the instants of the built-in table"] == 0.2
    assert found.metrics[dam_break.PRESSURES[3]] == pytest.approx(0.479, abs=0.001), "of nothing against the table"
    assert found.metrics[dam_break.PEAK] == 0.0, "of the whole series, not that of the window"
    assert found.metrics[dam_break.LEVELS[0]] == 0.03
    assert found.curves["z = 3 mm"][0][0] == 0.05, "shifted as the comparison was"
