"""The wall as a body: rows of the table and its case-file keys."""

import numpy as np
import pytest

from spume.bodies import Wall
from spume.geometry import Box, Sphere, Tank
from spume.particles import DUMMY, WALL
from spume.problems import CaseError


def test_rows_have_everything_the_table_needs():
    wall = Wall(name="tank", shape=Tank(lower=(0, 0), upper=(1, 0.5), open=("top",)), velocity=(2.0, 0.0))
    rows = wall.rows(0.1, 2)
    n = len(rows["kind"])
    assert set(np.unique(rows["kind"])) == {WALL, DUMMY}
    assert rows["position"].shape == rows["to_surface"].shape == rows["velocity"].shape == (n, 2)
    assert np.all(rows["velocity"] == [2.0, 0.0])
    assert np.all(rows["kind"][rows["master"]] == WALL)
    surface = rows["position"] + rows["to_surface"]
    rim = surface[:, 1] > 0.5 - 1e-9
    assert rim.any()
    assert wall.shape.distance(surface[~rim]) == pytest.approx(0.0, abs=1e-12)


def test_origin_moves_the_lattice():
    wall = Wall(name="ball", shape=Sphere(centre=(0.5, 0.5), radius=0.3))
    here, there = wall.rows(0.1, 2, (0.0, 0.0)), wall.rows(0.1, 2, (0.05, 0.0))
    assert not np.allclose(np.mod(here["position"][0], 0.1), np.mod(there["position"][0], 0.1))


def test_a_tank_is_wet_inside_and_other_shapes_outside():
    assert Wall(name="a", shape=Tank(lower=(0, 0), upper=(1, 1))).wet_inside
    assert not Wall(name="a", shape=Box(lower=(0, 0), upper=(1, 1))).wet_inside
    assert Wall(name="a", shape=Box(lower=(0, 0), upper=(1, 1)), wetted="inside").wet_inside
    with pytest.raises(CaseError, match="wet inside"):
        Wall(name="a", shape=Tank(lower=(0, 0), upper=(1, 1)), wetted="outside")


def test_core_of_a_solid_body():
    block = Wall(name="a", shape=Box(lower=(0, 0), upper=(1, 1)))
    assert block.core(np.array([[0.5, 0.5], [1.5, 0.5]]), 0.1, (0.0, 0.0)).tolist() == [True, False]
