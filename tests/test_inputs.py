"""Files that a case names: copies in the run folder, which is whole without the originals."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh

import spume
from spume import inputs
from spume.named import CASES
from spume.outputs import checkpoint
from spume.run import resume, run
from test_resume import assert_same, at_step, terminate

CASE = """\
spacing = 0.1
dimension = 3
threads = 1
[time]
end = {end}
[domain]
gravity = {{ kind = "table", file = "motion/gravity.csv" }}
[[fluid]]
name = "water"
shape = {{ kind = "box", lower = [0, 0, 0], upper = [0.5, 0.5, 0.5] }}
density = 1000.0
viscosity = 1.0e-6
[[body]]
name = "tank"
kind = "wall"
shape = {{ kind = "tank", lower = [0, 0, 0], upper = [1, 0.5, 1], open = ["top"] }}
[[body]]
name = "step"
kind = "wall"
shape = {{ kind = "stl", file = "step.stl" }}
[[gauge]]
name = "level"
kind = "elevation"
at = [0.25, 0.25]
[[gauge]]
name = "volume"
kind = "volume"
[[gauge]]
name = "hit"
kind = "pressure"
at = [1.0, 0.25, 0.05]
[[reference]]
gauge = "level"
file = "gravity.csv"
label = "h [m]"
source = "nobody"
[[reference]]
gauge = "hit"
file = "dam-break/pressure-2.csv"
label = "p [Pa]"
source = "Lobovský et al. (2014)"
[output]
interval = 0.05
pictures = false
animation = "none"
checkpoint_interval = 0.0
"""


@pytest.fixture
def case(tmp_path):
    """A case beside its drawing and two tables of one name."""
    folder = tmp_path / "given"
    (folder / "motion").mkdir(parents=True)
    trimesh.creation.box(bounds=[[0.6, 0.1, 0.0], [0.9, 0.4, 0.3]]).export(folder / "step.stl")
    (folder / "motion" / "gravity.csv").write_text("time,x,y,z\n0,0,0,-9.81\n1,2,0,-9.81\n")
    (folder / "gravity.csv").write_text("t,h\n0,0.5\n1,0.4\n")
    (folder / "case.toml").write_text(CASE.format(end=0.15))
    return spume.load(folder / "case.toml")


def test_the_folder_holds_a_copy_of_every_file_of_the_user(case, tmp_path):
    originals = list(inputs.files_of(case))
    here = inputs.kept(case, tmp_path / "run")
    own = [path for path in inputs.files_of(here) if not path.is_relative_to(CASES)]
    names = [path.relative_to(tmp_path / "run").as_posix() for path in own]
    assert names == ["inputs/gravity.csv", "inputs/step.stl", "inputs/gravity-2.csv"]
    for was, now in zip(originals, inputs.files_of(here), strict=True):
        assert was.read_bytes() == now.read_bytes()
    assert [p for p in inputs.files_of(here) if p.is_relative_to(CASES)] == [CASES / "dam-break" / "pressure-2.csv"]
    assert here.origin is case.origin  # mistakes still name the user's file


def test_a_case_without_files_stays_as_it_is(tmp_path):
    case = spume.load("hydrostatic")
    assert inputs.kept(case, tmp_path) is case
    assert not list(tmp_path.iterdir())


def test_a_run_goes_on_elsewhere_without_the_originals(case, tmp_path, monkeypatch):
    run(case, tmp_path / "whole")
    with monkeypatch.context() as patch:
        at_step(patch, 3, terminate)
        assert run(case, tmp_path / "run").status == "interrupted"
    shutil.rmtree(tmp_path / "given")
    moved = tmp_path / "elsewhere" / "run"
    moved.parent.mkdir()
    (tmp_path / "run").rename(moved)
    text = (moved / "case.toml").read_text()
    assert str(tmp_path) not in text
    assert str(tmp_path) not in checkpoint.read(moved).case
    monkeypatch.chdir(moved.parent)
    assert resume("run").status == "finished"
    assert_same(tmp_path / "whole", moved)


def test_a_copied_case_repeats_the_run(case, tmp_path):
    run(case, tmp_path / "one")
    shutil.rmtree(tmp_path / "given")
    run(spume.load(tmp_path / "one"), tmp_path / "two")
    assert_same(tmp_path / "one", tmp_path / "two")
    assert (tmp_path / "one" / "case.toml").read_text() == (tmp_path / "two" / "case.toml").read_text()


def test_only_what_a_file_changes_is_another_object(case, tmp_path):
    here = inputs.kept(case, tmp_path / "run")
    assert here.fluid == case.fluid
    assert here.gauge == case.gauge
    drawn, given = here.body[1].shape, case.body[1].shape
    assert drawn.file != given.file
    assert np.array_equal(drawn.facets().vertices, given.facets().vertices)


def test_files_of_one_name_are_told_apart_in_a_relative_folder_too(case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    here = inputs.kept(case, Path("run"))
    own = [path for path in inputs.files_of(here) if not path.is_relative_to(CASES)]
    assert sorted(path.name for path in own) == ["gravity-2.csv", "gravity.csv", "step.stl"]
    assert len({path.read_bytes() for path in own}) == 3
    assert all(path.is_absolute() for path in own)
