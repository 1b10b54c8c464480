"""What moves in a case: bodies in the run's frame, which of them move together, and where they get to."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume.case import Case
from spume.motion import Composed, Motion
from spume.named import Location
from spume.particles import FLUID

_INSTANTS = 400  # at which a motion is looked at to find how far it goes


def bodies_of(case: Case) -> tuple[Any, ...]:
    """Return the bodies with their motions in the run's frame: in the laboratory that of the tank is added."""
    tank = case.domain.motion
    if tank is None or case.domain.frame == "tank":
        return case.body
    bodies: list[Any] = []
    for body in case.body:
        if "motion" in type(body).model_fields:
            own = getattr(body, "motion", None)
            motion = tank if own is None else Composed(outer=tank, inner=own)
            bodies.append(body.model_copy(update={"motion": motion}))
        else:
            bodies.append(body)
    return tuple(bodies)


def moving_together(case: Case) -> list[list[int]]:
    """Return the bodies in groups that never part from each other; those that rest come first."""
    groups: list[tuple[Any, list[int]]] = []
    for index, body in enumerate(case.body):
        way = getattr(body, "motion", None), getattr(body, "until", None)
        for other, members in groups:
            if other == way:
                members.append(index)
                break
        else:
            groups.append((way, [index]))
    return [members for _, members in sorted(groups, key=lambda group: group[0] != (None, None))]


def set_in_motion(case: Case, bodies: Sequence[Any], rows: dict[str, NDArray[Any]]) -> None:
    """Write where rows started, and give those of moving bodies the velocity that they start with.

    What the tank holds starts with the velocity that its initial fields give it relative to the tank. The rows are
    those of `spume.build.initial_rows`: names to arrays of shape (n, …), changed in place.
    """
    rows["start_position"], rows["start_to_surface"] = rows["position"], rows["to_surface"]
    rows["velocity"] = rows["velocity"].copy()
    for index, body in enumerate(bodies):
        mine = rows["body"] == index
        if getattr(body, "motion", None) is not None and mine.any():
            rows["velocity"][mine] = body.motion.velocity_at(rows["position"][mine], 0.0)
    if case.domain.motion is not None and case.domain.frame == "laboratory":
        fluid = rows["kind"] == FLUID
        rows["velocity"][fluid] += case.domain.motion.velocity_at(rows["position"][fluid], 0.0)


def reached(
    case: Case, lower: NDArray[np.float64], upper: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the corners [m], shape (d,), of a box that holds a box of rows wherever the motions of bodies take it."""
    corners = _corners((lower, upper))
    for body in bodies_of(case):
        motion: Motion | None = getattr(body, "motion", None)
        if motion is None:
            continue
        for t in np.linspace(0.0, case.time.end, _INSTANTS):
            there = motion.pose(float(t), case.dimension)(corners)
            lower, upper = np.minimum(lower, there.min(axis=0)), np.maximum(upper, there.max(axis=0))
    return lower, upper


def speeds(case: Case) -> dict[Location, NDArray[np.float64]]:
    """Return for each motion that drives the flow the largest speed of what it moves [m/s], at instants of the run.

    Instants are evenly spaced over the run, arrays of shape (instants,). In a tank's own frame the tank rests; what
    the fluid feels is by how much the tank's velocity differs from that at the start.
    """
    instants = np.linspace(0.0, case.time.end, _INSTANTS)
    found: dict[Location, NDArray[np.float64]] = {}
    for index, body in enumerate(bodies_of(case)):
        motion: Motion | None = getattr(body, "motion", None)
        if motion is None or not hasattr(body, "shape"):
            continue
        loc: Location = ("body", index, "motion")
        if getattr(case.body[index], "motion", None) is None:
            loc = ("domain", "motion")
        corners, last = _corners(body.shape.bounds()), getattr(body, "until", None) or np.inf
        mine = [_fastest(motion.velocity_at(corners, float(t))) if t <= last else 0.0 for t in instants]
        found[loc] = np.maximum(found.get(loc, 0.0), mine)
    tank = case.domain.motion
    if tank is not None and case.domain.frame == "tank" and case.fluid:
        bounds = np.array([fluid.shape.bounds() for fluid in case.fluid])
        corners = _corners((bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)))
        start = tank.velocity_at(corners, 0.0)
        changes = [_fastest(tank.velocity_at(corners, float(t)) - start) for t in instants]
        found["domain", "motion"] = np.array(changes)
    return found


def _corners(bounds: tuple[NDArray[np.float64], NDArray[np.float64]]) -> NDArray[np.float64]:
    """Return the corners [m] of a box, shape (2^d, d)."""
    return np.stack(np.meshgrid(*zip(*bounds, strict=True)), axis=-1).reshape(-1, len(bounds[0]))


def _fastest(velocity: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(velocity, axis=1).max())
