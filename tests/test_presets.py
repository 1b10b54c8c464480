"""Presets: defaults that what a case says goes before."""

from typing import get_args

import pytest

from spume import presets
from spume.case import Case, Time, load
from spume.steps.project_in_place import ProjectInPlace


def test_names_are_those_that_a_case_takes():
    assert set(presets.names()) == set(get_args(Case.model_fields["preset"].annotation))
    assert presets.names()[0] == presets.USUAL
    assert {"recommended", "violent", "waves", "confined", "original-1996"} <= set(presets.names())


@pytest.mark.parametrize("name", presets.names())
def test_a_completed_case_gives_itself(name, tmp_path):
    case = load("taylor-green", [f"preset={name}"])
    path = tmp_path / "case.toml"
    path.write_text(case.to_toml())
    assert load(path).to_toml() == case.to_toml()


def test_the_usual_one_changes_nothing():
    assert load("dam-break", ["preset=recommended"]).step == ProjectInPlace()


def test_what_a_case_says_goes_before():
    confined = load("hydrostatic", ["preset=confined", "body.tank.layers=4"])
    assert confined.step.free_surface.key != ProjectInPlace().free_surface.key
    mine = load("hydrostatic", ["preset=confined", "body.tank.layers=4", "step.shifting=none", "time.courant=0.33"])
    assert (mine.step.shifting.key, mine.time.courant) == ("none", 0.33)
    assert mine.step.free_surface == confined.step.free_surface


def test_a_preset_says_nothing_of_another_algorithm():
    other = load("hydrostatic", ["preset=confined", "step=predict-move-project"]).step
    assert other == load("hydrostatic", ["step=predict-move-project"]).step


def test_times_given_as_an_object_take_what_it_does_not_set():
    document = load("hydrostatic").table()
    del document["time"]
    case = Case(**document | {"preset": "violent"}, time=Time(end=1.0, travel=0.4))
    assert (case.time.courant, case.time.travel) == (0.25, 0.4)


def test_a_step_given_as_an_object_is_taken_as_it_is():
    document = load("hydrostatic").table()
    del document["step"]
    case = Case(**document | {"preset": "confined"}, step=ProjectInPlace())
    assert case.step == ProjectInPlace()


def test_a_table_that_names_no_model_changes_the_one_of_the_preset():
    violent = load("dam-break", ["preset=violent"]).step.viscosity
    mine = load("dam-break", ["preset=violent", "step.viscosity.turbulence.constant=0.1"]).step.viscosity
    assert mine == violent.model_copy(update={"turbulence": violent.turbulence.model_copy(update={"constant": 0.1})})
    other = load("dam-break", ["preset=violent", "step.viscosity={name='explicit'}"]).step.viscosity
    assert other.wall_function.key == "none", "one that names its model is about that model alone"


def test_a_table_that_names_no_model_changes_the_one_of_the_step():
    """The step's own viscosity has another laplacian than the viscosity's default."""
    usual = ProjectInPlace().viscosity
    mine = load("standing-wave", ["step.viscosity.turbulence=smagorinsky"]).step.viscosity
    assert (mine.laplacian, mine.turbulence.key) == (usual.laplacian, "smagorinsky")
    wider = load("standing-wave", ["step.number_density.re=3.1", "body.tank.layers=4"]).step.number_density
    assert wider == ProjectInPlace().number_density.model_copy(update={"re": 3.1})
