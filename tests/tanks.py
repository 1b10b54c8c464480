"""Small cases that tests of whole steps share, made by the Python API."""

from math import inf

import numpy as np

import spume
from spume.particles import FLUID
from spume.steps.predict_move_project import PredictMoveProject
from spume.steps.project_in_place import ProjectInPlace

STEPS = {"project-in-place": ProjectInPlace, "predict-move-project": PredictMoveProject}


def column(l0=0.025, cells=(8, 20), step=None, periodic=False, step_max=None, **more):
    """Return the case of a column of water at rest, in a tank or (periodic along x) on a floor."""
    width, height = cells[0] * l0, cells[1] * l0
    water = spume.Fluid(name="water", shape=spume.Box(lower=[0.0, 0.0], upper=[width, height]), **more)
    faces = ["left", "right", "top"] if periodic else ["top"]
    tank = spume.Tank(lower=[0.0, 0.0], upper=[width, 1.5 * height], open=faces)
    joined = {"periodic": ["x"], "lower": [0.0, -1.0], "upper": [width, 2.0]} if periodic else {}
    return spume.Case(
        spacing=l0, time=spume.Time(end=10.0, step_max=step_max), domain=spume.Domain(**joined), fluid=[water],
        body=[spume.Wall(name="tank", shape=tank)], step=step or ProjectInPlace(),
    )  # fmt: skip


def dam_break(l0=0.02, start=0, cells=(10, 10), length=30, shift=(0.0, 0.0), turned=False, step=None):
    """Return the case of a column that collapses in an open tank.

    Args:
        start: distance of the column from the left wall, in spacings.
        cells: width and height of the column, in spacings.
        length: length of the tank, in spacings.
        shift: position of the tank's lower left corner [m].
        turned: turn everything by 90 degrees anticlockwise, gravity included.
    """
    corners = {
        "water": ((start, 0), (start + cells[0], cells[1])),
        "tank": ((0, 0), (length, 1.5 * cells[1])),
    }
    if turned:
        corners = {name: ((-upper[1], lower[0]), (-lower[1], upper[0])) for name, (lower, upper) in corners.items()}
    boxes = {
        name: {
            end: [float(c * l0 + s) for c, s in zip(corner, shift, strict=True)]
            for end, corner in zip(("lower", "upper"), pair, strict=True)
        }
        for name, pair in corners.items()
    }
    return spume.Case(
        spacing=l0, time=spume.Time(end=10.0),
        domain=spume.Domain(gravity=[9.81, 0.0] if turned else [0.0, -9.81]),
        fluid=[spume.Fluid(name="water", shape=spume.Box(**boxes["water"]))],
        body=[spume.Wall(name="tank", shape=spume.Tank(**boxes["tank"], open=["left" if turned else "top"]))],
        step=step or ProjectInPlace(),
    )  # fmt: skip


def drop(l0=0.02, radius=0.2, gravity=(0.0, -9.81), **more):
    """Return the case of a round drop without walls, around the origin."""
    fluid = spume.Fluid(name="water", shape=spume.Sphere(centre=[0.0, 0.0], radius=radius), **more.pop("fluid", {}))
    return spume.Case(
        spacing=l0, time=spume.Time(end=10.0, **more.pop("time", {})), domain=spume.Domain(gravity=gravity),
        fluid=[fluid], **more,
    )  # fmt: skip


def by_id(simulation, *names, kinds=FLUID):
    """Return fields of the rows of some kinds, in the order of their ids."""
    ids = simulation.fetch("id")
    order = np.argsort(ids)
    chosen = (simulation.fetch("kind")[order] & kinds) != 0
    found = tuple(simulation.fetch(name)[order][chosen] for name in names)
    return found[0] if len(found) == 1 else found


def advanced(simulation, steps=inf, until=inf):
    """Return the simulation, advanced by some steps or until a time [s]."""
    while steps > 0 and simulation.time < until:
        simulation.advance()
        steps -= 1
    return simulation
