"""Validation cases: found by name, their exact solutions, orders and verdicts."""

import math

import numpy as np
import pytest

from spume.case import built_in_cases, load
from spume.problems import CaseError
from spume.validation import driver, study
from spume.validation.cases import channel, elliptical_drop, faraday, linear_sway, standing_wave
from spume.validation.study import Bar, Measured, Panel, Run, Study

EVERY = study.studies()


def test_the_cases_asked_for_exist():
    wanted = {"1", "2", "3", "4a", "4b", "5", "6a", "6b", "7a", "7b", "7c", "7d", "9a", "9b"}
    numbers = [s.number for s in EVERY.values()]
    assert wanted <= set(numbers)
    assert len(set(numbers)) == len(numbers)


@pytest.mark.parametrize("name", EVERY)
def test_runs_are_cases_and_bars_are_of_their_series(name):
    s = EVERY[name]
    assert len({run.name for run in s.runs}) == len(s.runs)
    for run in {*s.runs, *s.quick}:
        assert run.case in built_in_cases()
        load(run.case, driver.settings_of(run))
    for bar in s.bars:
        assert bar.series in {run.series for run in s.runs}
        assert bar.lower < bar.upper or bar.lower == bar.upper == 0.0


def test_three_resolutions_of_what_is_judged():
    for s in EVERY.values():
        for series in {bar.series for bar in s.bars}:
            assert len([run for run in s.runs if run.series == series]) >= 2, (s.name, series)


def test_chosen_takes_names_numbers_and_whole_groups():
    assert [s.name for s in study.chosen(["5", "hydrostatic"])] == ["standing-wave", "hydrostatic"]
    assert [s.number for s in study.chosen(["4", "4a"])] == ["4a", "4b"]
    with pytest.raises(CaseError, match="did you mean 'hydrostatic'"):
        study.chosen(["hydrostatics"])


def test_order_is_the_slope():
    assert study.order([10, 20, 40], [4e-2, 1e-2, 2.5e-3]) == pytest.approx(2.0)
    assert math.isnan(study.order([10], [1.0]))


def test_verdicts_take_the_finest_run_of_the_series():
    runs = [Run("hydrostatic", n, series=s) for s in ("a", "b") for n in (10, 20)]
    measured = {run: Measured({"error": 1.0 / run.cells + (run.series == "b")}) for run in runs}
    bar = Bar("error", 0.06, series="a", cells=40, quick=(0.0, 0.01))
    found = driver.verdict(bar, measured, {}, quick=False)
    assert (found.reached, found.cells, found.word) == (0.05, 20, "holds")
    assert driver.verdict(bar, measured, {}, quick=True).word == "MISSED"
    assert driver.verdict(Bar("error", 0.06, series="b"), measured, {}, quick=False).word == "MISSED"
    assert (
        driver.verdict(Bar("error", 0.06, series="c"), measured, {}, quick=False).word == "MISSED"
    )  # no run: no verdict
    assert driver.verdict(Bar("error", 0.06, series="a"), measured, {}, quick=True).word == "not judged"
    s = Study("0", "", "n", "", tuple(runs), (), lambda _: Measured({}), (), orders=("error",))
    orders = driver.observed_orders(s, measured)
    assert orders["a", "error"] == pytest.approx(1.0)
    found = driver.verdict(Bar("order: error", lower=1.5, series="a"), measured, orders, quick=False)
    assert found.word == "MISSED"


def test_exact_channel_flows_solve_the_diffusion_equation():
    y, t, h, k = np.linspace(0.2, 0.8, 7), 0.3, 1e-3, 1e-4
    for flow, force in ((channel.couette, 0.0), (channel.poiseuille, channel.FORCE)):
        rate = (flow(y, t + k) - flow(y, t - k)) / (2 * k)
        bend = (flow(y + h, t) - 2 * flow(y, t) + flow(y - h, t)) / h**2
        assert rate == pytest.approx(channel.VISCOSITY * bend + force, rel=1e-3, abs=1e-3)
        assert flow(np.array([0.0]), t) == pytest.approx(0.0, abs=1e-9)
    assert channel.couette(np.array([1.0]), t) == pytest.approx(channel.LID, abs=1e-6)


def test_exact_drop_keeps_its_energy():
    times, axis = elliptical_drop.solution(1.0, 1.0, 4.827343)
    strain = np.gradient(np.log(axis), times)
    # Kinetic and potential energy of an ellipse with semi-axes a, 1/a, over that of the disk.
    energy = (strain**2 + 1.0) * (axis**2 + axis**-2) / 4.0
    assert energy[5:-5] == pytest.approx(1.0, rel=2e-3)
    assert axis[-1] == pytest.approx(1.0, abs=1e-4)  # a whole period


def test_exact_sway_starts_at_rest_with_the_impulse():
    t = np.array([0.0, 1e-3])
    left, right = linear_sway.exact(t, 0.0), linear_sway.exact(t, 1.0)
    assert left[0] == 0.0
    assert left[1] == pytest.approx(-right[1])
    assert left[1] > 0.0, "the water stays behind: it rises at the wall that comes towards it"


def test_exact_standing_wave_of_small_amplitude_is_a_cosine():
    times, crest, trough = standing_wave.potential_flow(0.001)
    a = 0.001 / standing_wave.K
    exact = a * np.cos(2.0 * math.pi * times / standing_wave.PERIOD)
    assert crest == pytest.approx(exact, abs=2e-3 * a)
    assert trough == pytest.approx(-exact, abs=2e-3 * a)
    steep = standing_wave.potential_flow(0.2)[1]
    assert steep.max() * standing_wave.K / 0.2 > 1.05, "crests of a steep wave rise above its start"


def test_mathieu_grows_where_it_should():
    (t, growing), (_, stable) = faraday.mathieu("growing"), faraday.mathieu("stable")
    assert np.abs(growing).max() > 5.0
    assert np.abs(stable).max() < 2.0
    # Exponent of the first order in the strength: (a Omega^2/g) omega_1/4.
    rate = faraday._rate(t, growing)
    assert rate == pytest.approx(faraday.STRENGTH * faraday.FIRST / 4.0, rel=0.15)


def test_report_says_what_was_missed(tmp_path):
    import json

    from spume.validation import report

    run = Run("hydrostatic", 10)
    s = Study("1", "title", "H/l0", "exact", (run,), (run,), lambda _: Measured({}), (Bar("error", 0.1, cells=40),),
              panels={"curve": Panel("x", "y")}, name="some-case")  # fmt: skip
    measured = {run: Measured({"error": 0.2}, {"curve": (np.arange(3.0), np.arange(3.0))})}
    results = {
        "case": s.name, "number": s.number, "title": s.title, "length": s.length, "reference": s.reference,
        "date": "2026-01-01", "machine": "m", "quick": False, "orders": [],
        "bars": [{"metric": "error", "series": "", "lower": None, "upper": 0.1, "cells": 10, "meant for cells": 40,
                  "reached": 0.2, "verdict": driver.verdict(s.bars[0], measured, {}, quick=False).word}],
        "runs": [{"name": "10", "status": "failed", "reason": "exploded", "series": "", "cells": 10}],
    }  # fmt: skip
    (tmp_path / s.name).mkdir()
    (tmp_path / s.name / "results.json").write_text(json.dumps(results))
    report.figure(s, measured, tmp_path / s.name / "figure.png")
    report.write(tmp_path)
    text = (tmp_path / "report.md").read_text()
    assert "| 1 some-case | error | ≤ 0.1 | 0.2 | H/l0 = 10 (meant for 40) | **MISSED** |" in text
    assert "exploded" in text
    assert "figure.png" in text


@pytest.mark.parametrize("scale", ["linear", "log"])
def test_no_curve_runs_behind_a_legend(scale):
    from matplotlib.figure import Figure

    from spume.validation import report

    drawn = Figure(figsize=(5.2, 3.4), layout="constrained")
    axis = drawn.subplots()
    axis.set_yscale(scale)
    largest = 10.0
    for k in range(5):
        axis.plot([0.0, 1.0], [1.0 + k, largest], label=f"h/l0 = {k}")
    report._legend(axis, room=True)
    drawn.canvas.draw()
    lower_edge = axis.get_legend().get_window_extent().y0
    assert axis.transData.transform((1.0, largest))[1] < lower_edge
