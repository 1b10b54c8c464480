"""The driver of validation cases: a finished run is not repeated, an interrupted one goes on, a failed one stays."""

import json

import pytest

from spume.case import load
from spume.validation import driver
from spume.validation.folder import Folder, budgets
from spume.validation.study import Bar, Measured, Run, Study

SHORT = Run("couette", 20, ("spacing=0.05", "time.end=0.3"))


def measure(folder):
    return Measured({"speed": float(folder.last()["velocity"].max())})


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """The folder of a short run, and the status that its execution gave."""
    task = driver.Task(SHORT, tmp_path_factory.mktemp("out") / "case" / "runs" / SHORT.name)
    return task, driver.execute(task)


def test_a_finished_run_is_not_repeated(done):
    task, status = done
    assert status == "finished"
    before = (task.folder / "summary.json").stat().st_mtime_ns
    assert driver.ended(task)
    assert driver.execute(task) == "finished"
    assert (task.folder / "summary.json").stat().st_mtime_ns == before


def test_a_run_of_another_case_is_new(done):
    task, _ = done
    other = load("couette", [*driver.settings_of(SHORT), "time.end=0.06"]).to_toml()
    assert driver.status_of(task.folder, other) == "new"
    summary = task.folder / "summary.json"
    text = summary.read_text()
    same = load("couette", driver.settings_of(SHORT)).to_toml()
    try:
        summary.write_text(json.dumps(json.loads(text) | {"status": "interrupted"}))
        assert driver.status_of(task.folder, same) == "interrupted"
        summary.write_text(json.dumps(json.loads(text) | {"status": "failed"}))
        assert driver.status_of(task.folder, same) == "failed"
    finally:
        summary.write_text(text)


def test_results_hold_metrics_budgets_and_verdicts(done):
    task, _ = done
    study = Study("0", "t", "n", "r", (SHORT,), (SHORT,), measure, (Bar("speed", 1e-9), Bar("speed", 10.0)))
    results, measured = driver.judge(study, [task], quick=False)
    assert measured[SHORT].metrics["speed"] > 0.0
    run = results["runs"][0]
    assert run["status"] == "finished"
    assert run["steps"] > 0
    assert {"clipped", "removed", "collisions"} <= set(run["counts"])
    assert [bar["verdict"] for bar in results["bars"]] == ["MISSED", "holds"]
    found = budgets(Folder(task.folder))
    assert found["momentum, largest change / sqrt(2 m E)"] > 0.0, "the plate drags the liquid"
    assert abs(found["volume, last change"]) < 0.01


def test_repetitions_are_runs_of_their_own_and_judged_by_their_mean():
    once, twice, thrice = Run("dam-break", 30).repeated(3)
    coarse = Run("dam-break", 10)
    assert [run.name for run in (once, twice, thrice)] == ["30", "30-repeat-1", "30-repeat-2"]
    cases = [load(run.case, driver.settings_of(run)) for run in (once, twice, thrice)]
    assert [case.time.courant for case in cases] == pytest.approx([0.25, 0.2525, 0.2475])
    assert [case.time.travel for case in cases] == pytest.approx([0.75, 0.7575, 0.7425])
    assert len({case.to_toml() for case in cases}) == 3
    values = {coarse: 9.0, once: 1.0, twice: 2.0, thrice: 6.0}
    measured = {run: Measured({"error": value}) for run, value in values.items()}
    study = Study("0", "t", "n", "r", tuple(values), (), measure, (), orders=("error",))
    found = driver.verdict(Bar("error", 2.5), measured, {}, quick=False)
    assert (found.reached, found.cells, found.runs, found.word) == (3.0, 30, 3, "MISSED")
    assert driver.observed_orders(study, measured) == {("", "error"): pytest.approx(1.0)}
