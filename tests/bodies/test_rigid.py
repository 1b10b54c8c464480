"""Bodies in motion: their rows follow exactly, and what they leave is whole."""

import numpy as np
import pytest

import spume
from spume.case import read
from spume.particles import SOLID, WALL
from spume.problems import CaseError, Origin
from tanks import by_id

ROLL = {"kind": "sinusoid", "amplitude_deg": 5.0, "amplitude": [0.02, 0.01], "period": 0.2, "centre": [0.1, 0.05]}


def tank(l0=0.025, cells=(8, 4), bodies=(), end=10.0, **domain):
    """Return the case of a tank of shallow water, with more bodies."""
    width, height = cells[0] * l0, cells[1] * l0
    return {
        "spacing": l0, "time": {"end": end}, "domain": domain,
        "fluid": [{"name": "water", "shape": {"kind": "box", "lower": [0.0, 0.0], "upper": [width, height]}}],
        "body": [
            {"name": "tank", "kind": "wall", "shape": {
                "kind": "tank", "lower": [0.0, 0.0], "upper": [width, 3 * height], "open": ["top"]}},
            *bodies,
        ],
    }  # fmt: skip


def built(document, device):
    return spume.Case.model_validate(document).build(device=device, threads=1, precision="double")


def test_rows_follow_the_motion_exactly(device):
    """After 300 steps as after one: no drift accumulates, and normals turn along."""
    document = tank()
    document["body"][0]["motion"] = ROLL
    simulation = built(document, device)
    motion = simulation.domain.bodies[0].motion
    start, facing = by_id(simulation, "position", "to_surface", kinds=SOLID)
    for _ in range(300):
        before = by_id(simulation, "position", kinds=SOLID)
        t = simulation.time
        simulation.advance()
        x, u, n = by_id(simulation, "position", "velocity", "to_surface", kinds=SOLID)
        pose = motion.pose(simulation.time, 2)
        assert x == pytest.approx(pose(start), abs=1e-14)
        assert n == pytest.approx(pose.turned(facing), abs=1e-14)
        # The velocity that the fluid sees is the one that takes the wall there.
        assert u * (simulation.time - t) == pytest.approx(x - before, abs=1e-12)
    assert simulation.time > 0.2, "more than a period"


def test_prescribe_can_be_repeated(device):
    document = tank()
    document["body"][0]["motion"] = ROLL
    simulation = built(document, device)
    body, particles = simulation.domain.bodies[0], simulation.particles
    body.prescribe(particles, 0.3, 0.01)
    once = particles.numpy("wall_velocity")
    body.prescribe(particles, 0.7, 0.02)
    assert not np.allclose(particles.numpy("wall_velocity"), once)
    body.prescribe(particles, 0.3, 0.01)
    assert np.array_equal(particles.numpy("wall_velocity"), once)


def test_a_body_is_there_until_a_time(device):
    gate = {"name": "gate", "kind": "wall", "until": 0.02,
            "shape": {"kind": "box", "lower": [0.2, 0.0], "upper": [0.275, 0.3]}}  # fmt: skip
    document = tank(cells=(8, 4), bodies=[gate])
    document["body"][0]["shape"]["upper"][0] = 0.4
    simulation = built(document, device)
    rows = int((simulation.fetch("body") == 1).sum())
    assert rows == 3 * 12
    while simulation.time < 0.02:
        assert int((simulation.fetch("body") == 1).sum()) == rows
        simulation.advance()
    held = by_id(simulation, "position")[:, 0].max()
    assert held < 0.2, "the gate holds the water while it is there"
    simulation.advance()
    assert not np.any(simulation.fetch("body") == 1)
    while simulation.time < 0.1:
        simulation.advance()
    assert by_id(simulation, "position")[:, 0].max() > 0.22, "the water runs where the gate stood"


def test_what_moves_away_leaves_the_others_whole(device):
    """A gate that reaches into the floor gives way to it; a resting block takes the place of floor rows."""
    reaching = {"name": "block", "kind": "wall",
                "shape": {"kind": "box", "lower": [0.2, -0.075], "upper": [0.275, 0.15]}}  # fmt: skip
    document = tank(cells=(16, 4), bodies=[reaching])
    document["fluid"][0]["shape"]["upper"] = [0.2, 0.1]
    simple = tank(cells=(16, 4))
    simple["fluid"] = document["fluid"]

    def floor(case):
        simulation = built(case, device)
        body, kind = simulation.fetch("body"), simulation.fetch("kind")
        return int((body == 0).sum()), int(((body == 0) & (kind == WALL)).sum())

    whole = floor(simple)
    assert floor(document) != whole
    document["body"][1]["motion"] = {"kind": "uniform", "velocity": [0.0, 1.0]}
    assert floor(document) == whole


def test_a_moving_wall_limits_the_time_step(device):
    document = tank()
    document["body"][0]["motion"] = {"kind": "uniform", "velocity": [20.0, 0.0], "start": 1e-9}
    simulation = built(document, device)
    simulation.advance()
    slow = simulation.dt
    simulation.advance()
    assert simulation.dt <= 0.2 * 0.025 / 20.0 * (1 + 1e-12) < slow


MISTAKES = [
    ({"kind": "sinusoid", "amplitude_deg": 5.0, "period": 1.0, "axis": [0.0, 1.0, 0.0]}, "axis"),
    ({"kind": "sinusoid", "amplitude": [1.0, 0.0, 0.0], "period": 1.0}, "must have 2 numbers"),
    ({"kind": "sinusoid", "amplitude_deg": 5.0}, "give the period or the frequency"),
    ({"kind": "wobble"}, "one of"),
    ({"kind": "uniform", "speed": [1.0, 0.0]}, "no such key"),
    ({"kind": "series", "file": "absent.csv"}, "no such file"),
    ({"kind": "series", "file": "short.csv"}, "ends at 0.5 s"),
    ({"kind": "series", "file": "back.csv"}, "back.csv:4: time 0.5 s stands after 1 s"),
]


@pytest.mark.parametrize(("motion", "message"), MISTAKES)
def test_mistakes_in_a_motion_are_named(tmp_path, motion, message):
    (tmp_path / "short.csv").write_text("time,x\n0,0\n0.5,1\n")
    (tmp_path / "back.csv").write_text("time,x\n0,0\n1,1\n0.5,0\n")
    document = tank()
    document["body"][0]["motion"] = motion
    with pytest.raises(CaseError, match=message) as error:
        read(document, Origin("case.toml", document), folder=tmp_path)
    assert all("body.tank.motion" in str(problem) for problem in error.value.problems)


def test_a_table_must_last_as_long_as_its_body(tmp_path):
    (tmp_path / "short.csv").write_text("time,x\n0,0\n0.5,1\n")
    document = tank()
    document["body"][0] |= {"motion": {"kind": "series", "file": "short.csv"}, "until": 0.4}
    read(document, Origin("case.toml", document), folder=tmp_path)


def test_mistakes_in_a_frame_are_named():
    for domain, message in (
        ({"frame": "tank"}, "needs the motion"),
        ({"frame": "boat"}, "laboratory"),
        ({"motion": ROLL, "periodic": ["x"], "lower": [0.0, -1.0], "upper": [0.2, 1.0]}, "periodic domain cannot"),
    ):
        document = tank(**domain)
        with pytest.raises(CaseError, match=message):
            read(document, Origin("case.toml", document))
