"""The commands spume validate and spume atlas, without running anything."""

import pytest
from typer.testing import CliRunner

from spume.cli import app
from spume.cli.validate import table_of


@pytest.fixture(scope="module")
def call():
    return lambda *words: CliRunner().invoke(app, list(words), env={"COLUMNS": "200"})


def test_list_names_cases_and_runs(call):
    answer = call("validate", "--list", "6")
    assert answer.exit_code == 0
    assert "dam-break" in answer.output
    assert "martin-moyce" in answer.output
    assert "sloshing" not in answer.output


def test_an_unknown_case_is_input_to_correct(call):
    answer = call("validate", "hydrostatik", "--list")
    assert answer.exit_code == 2
    assert "did you mean 'hydrostatic'" in answer.output


def test_the_atlas_lists_what_it_would_run(call):
    answer = call("atlas", "--list", "--only", "umbrella")
    assert answer.exit_code == 0
    assert "free_surface umbrella: step.free_surface='umbrella'" in answer.output
    assert "gradient" not in answer.output


def test_the_table_shows_the_bar_beside_the_value():
    bar = {"metric": "error", "series": "Re 100", "lower": None, "upper": 0.01, "cells": 50, "reached": 0.02,
           "verdict": "MISSED"}  # fmt: skip
    table = table_of([{"number": "2", "case": "taylor-green", "length": "L/l0", "bars": [bar]}])
    cells = [next(iter(column.cells)) for column in table.columns]
    assert cells == ["2 taylor-green", "Re 100: error", "≤ 0.01", "0.02", "L/l0 = 50", "[red]MISSED[/red]"]
