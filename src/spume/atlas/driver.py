"""The driver of the atlas: every combination on every problem, and the results as one table of numbers."""

from __future__ import annotations

import json
import math
import platform
import re
from collections.abc import Callable, Sequence
from datetime import date
from pathlib import Path
from typing import Any

from spume import presets
from spume.atlas.combinations import Combination
from spume.atlas.problems import PROBLEMS, Problem, measure
from spume.outputs import summary
from spume.outputs.disk import replace_text
from spume.problems import CaseError
from spume.validation import driver
from spume.validation.folder import Folder
from spume.validation.study import Run

RESULTS = "atlas.json"


def run_of(combination: Combination, problem: Problem) -> Run:
    """Return the run of a combination on a problem."""
    from spume.case import find_case

    settings = [f"preset={presets.USUAL}", *problem.settings, *combination.settings]
    if combination.layers > 3 and "[[body]]" in find_case(problem.case)[0].read_text(encoding="utf-8"):
        settings.append(f"body.tank.layers={combination.layers}")
    return Run(problem.case, problem.cells, tuple(settings), combination.name)


def folder_of(out: Path, combination: Combination, problem: Problem) -> Path:
    """Return the run folder of a combination on a problem."""
    words = re.findall(r"[a-z0-9.]+", combination.name.lower())
    return out / "-".join(words) / driver.RUNS / problem.name.replace(" ", "-")


def compare(
    combinations: Sequence[Combination], out: Path, *, jobs: int, say: Callable[[str], None],
    problems: Sequence[Problem] = PROBLEMS, run: bool = True,
) -> dict[str, Any]:  # fmt: skip
    """Run what has not been run, measure everything, write ``atlas.json``; return what it holds.

    Args:
        combinations: the combinations.
        out: folder of everything.
        jobs: runs side by side.
        say: is told of every run that ends.
        problems: the problems.
        run: whether to run what is missing; without, it is left out of the table as not run.
    """
    tasks, refused = [], {}
    for combination in combinations:
        for problem in problems:
            task = driver.Task(run_of(combination, problem), folder_of(out, combination, problem))
            try:
                if not driver.ended(task):
                    tasks.append(task)
            except CaseError as error:
                refused[combination.name, problem.name] = str(error)
    if run:
        driver.do(tasks, jobs, say)
    if not run:
        combinations = [c for c in combinations if any(folder_of(out, c, p).exists() for p in problems)]
    entries = []
    for combination in combinations:
        for problem in problems:
            reason = refused.get((combination.name, problem.name))
            found = _entry(combination, problem, out) if reason is None else {"status": "refused", "reason": reason}
            entries.append({"combination": combination.name, "problem": problem.name, **found})
    results = {
        "date": date.today().isoformat(),
        "machine": f"{platform.machine()} {platform.system()}, Python {platform.python_version()}",
        "problems": [
            {"name": p.name, "case": p.case, "cells": p.cells, "settings": list(p.settings), "error": p.meaning,
             "scale": p.scale[1]}
            for p in problems
        ],
        "combinations": [{"name": c.name, "slot": c.slot, "settings": list(c.settings)} for c in combinations],
        "runs": entries,
    }  # fmt: skip
    results = driver.finite(results)
    replace_text(out / RESULTS, json.dumps(results, indent=1, ensure_ascii=False) + "\n")
    return results


def _entry(combination: Combination, problem: Problem, out: Path) -> dict[str, Any]:
    folder = Folder(folder_of(out, combination, problem))
    try:
        numbers = summary.read(folder.path)
    except (OSError, ValueError):
        return {"status": "not run", "reason": ""}
    if numbers["status"] == "running":
        return {"status": "not run", "reason": "runs, or was killed"}
    if numbers["status"] != "finished":
        return {"status": numbers["status"], "reason": numbers["reason"], "time": numbers["simulated_time"]}
    return {"status": "finished", **{k: _number(v) for k, v in measure(problem, folder).items()}}


def _number(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(f"{value:.4g}")
