"""Gravity: constant, by table, central."""

import pytest

from spume.gravity import Central, Constant, Gravity, Table
from spume.named import Parameters
from spume.problems import CaseError


class Holder(Parameters):
    gravity: Gravity


def test_a_bare_vector_is_a_constant():
    assert Holder(gravity=[0, -1]).gravity == Constant(vector=(0.0, -1.0))
    assert Holder(gravity=(0.0, -1.0)).gravity.at(3.0).tolist() == [0.0, -1.0]
    assert Holder(gravity=[0, -1]).gravity.stiffness == 0.0


def test_a_central_one():
    gravity = Holder(gravity={"kind": "central", "strength": 4, "centre": [1, 2]}).gravity
    assert isinstance(gravity, Central)
    assert gravity.at(0.0).tolist() == [0.0, 0.0]
    assert gravity.stiffness == 4.0
    assert gravity.focus.tolist() == [1.0, 2.0]


def test_a_table_is_linear_between_its_lines(tmp_path):
    path = tmp_path / "g.csv"
    path.write_text("time [s],x [m/s^2],y [m/s^2]\n0,0,-10\n2,4,-8\n")
    gravity = Table(file=path)
    assert gravity.at(1.0) == pytest.approx([2.0, -9.0])
    assert gravity.at(-1.0) == pytest.approx([0.0, -10.0])
    assert gravity.at(9.0) == pytest.approx([4.0, -8.0])
    assert gravity.model_dump() == {"file": path.as_posix()}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("time,x\n0,1\n", "allowed: time, x, y"),
        ("time,x,y\n1,0,0\n0,0,0\n", "times must increase"),
        ("time,x,y\n0,0,0\n0,0,0\n", "times must increase"),
        ("time,x,y\n0,0,nan\n", "finite"),
        ("time,x,y\n0,0,g\n", ":2:"),
    ],
)
def test_bad_tables_are_refused(tmp_path, text, words):
    path = tmp_path / "g.csv"
    path.write_text(text)
    with pytest.raises(CaseError, match=words):
        Table(file=path)
