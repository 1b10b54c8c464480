"""Every gradient model and every source, in every step that takes it: water at rest and a dam break, both coarse.

python validation/schemes/check.py [gradient|source] [2|3]

One slot is changed, all others are the step's defaults. Prints the tables of docs/schemes-measured.md.
"""

import math
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

import spume
from spume import named
from spume.build import build
from spume.named import Scheme
from spume.outputs.snapshot import Snapshot
from spume.particles import FLUID
from spume.schemes.gradient.cmps import Conservative
from spume.schemes.gradient.stabilised import Stabilised
from spume.simulation import Diverged
from spume.steps.base import Step
from spume.steps.predict_move_project import PredictMoveProject
from spume.steps.project_in_place import ProjectInPlace

G, RHO = 9.81, 1000.0
STEPS: tuple[type[Step], ...] = (ProjectInPlace, PredictMoveProject)
REST_STEPS, BREAK_STEPS = 100, 200


@dataclass
class Result:
    """What one run came to; NaN where it broke off."""

    broke: str = ""
    error: float = math.nan
    speed: float = math.nan
    disorder: float = math.nan
    nearest: float = math.nan


def choices(family: str) -> Iterator[tuple[str, Scheme]]:
    """Yield label and scheme of every model, with the forms that differ from its default."""
    for scheme in named.schemes(family):
        yield scheme.key, scheme()
    if family == "gradient":
        yield "cmps, consistent", Conservative(form="consistent")
        yield "stabilised, consistent", Stabilised(form="consistent")


def case(step: Step, dimension: int, *, at_rest: bool) -> spume.Case:
    """Return water of height H = 20 l0 (3D: 10 l0) that fills a tank, disturbed by 10 % of l0, or part of one."""
    cells = 20 if dimension == 2 else 10
    l0 = 0.4 / cells
    width = cells // 2 * l0
    length = width if at_rest else 2.5 * cells * l0
    side = [] if dimension == 2 else [0.5 * cells * l0 if at_rest else 4 * l0]
    zeros = [0.0] * dimension
    water = spume.Box(lower=zeros, upper=[width, *side, 0.4])
    tank = spume.Tank(lower=zeros, upper=[length, *side, 0.6], open=["top"])
    return spume.Case(
        spacing=l0, dimension=dimension, time=spume.Time(end=100.0), step=step,
        fluid=[spume.Fluid(name="water", shape=water, disturbance=0.1 if at_rest else 0.0)],
        body=[spume.Wall(name="tank", shape=tank)],
    )  # fmt: skip


def disorder(state: Snapshot, step: Step) -> tuple[float, float]:
    """Return the rms of l0 d/n0 |sum_j W r_ij/r^2| inside the fluid, and the smallest distance of two rows over l0."""
    model: Any = step.gradient
    x, l0, d = state["position"], state.spacing, state.dimension
    tree = cKDTree(x)
    inside = state.fluid & (state["surface_share"] == 0.0)
    uneven = []
    for i in np.flatnonzero(inside):
        near = [j for j in tree.query_ball_point(x[i], 2.1 * l0 * (1 - 1e-9)) if j != i]
        r = x[near] - x[i]
        s = np.linalg.norm(r, axis=1)
        w = model.weight.values(s, 2.1 * l0)
        uneven.append(np.linalg.norm(((w / s**2)[:, None] * r).sum(axis=0)))
    n0 = spume.lattice.Lattice(d, l0).n0(model.weight, 2.1)
    pairs, _ = tree.query(x[state.fluid], k=2)
    return float(l0 * d / n0 * np.sqrt(np.mean(np.square(uneven)))), float(pairs[:, 1].min() / l0)


def run(step: Step, dimension: int, *, at_rest: bool) -> Result:
    """Run one case; return what it came to."""
    simulation = build(case(step, dimension, at_rest=at_rest), threads=1)
    start = int(simulation.snapshot().fluid.sum())
    scale = math.sqrt(2 * G * 0.4)
    result, errors, fastest = Result(), [], 0.0
    total = REST_STEPS if at_rest else BREAK_STEPS
    try:
        for number in range(total):
            simulation.advance()
            fastest = simulation.particles.largest_norm("velocity", FLUID)
            if not fastest < 5 * scale:
                result.broke = f"faster than 5 √(2gH) at step {number + 1}"
                return result
            if at_rest and number >= total - 20:
                state = simulation.snapshot()
                y, p = state["position"][state.fluid, -1], state["pressure"][state.fluid]
                errors.append(np.sqrt(np.mean((p - RHO * G * (0.4 - y)) ** 2)) / (RHO * G * 0.4))
    except Diverged as error:
        result.broke = f"failed at step {simulation.step_index + 1}: {str(error).split(': ')[1][:40]}"
        return result
    state = simulation.snapshot()
    lost = start - int(state.fluid.sum())
    if lost:
        result.broke = f"lost {lost} particles"
    result.error = float(np.mean(errors)) if errors else math.nan
    result.speed = fastest / scale
    result.disorder, result.nearest = disorder(state, step)
    return result


def number(value: float, form: str) -> str:
    """Return a number for a cell of the table."""
    return "–" if math.isnan(value) else format(value, form)


def table(family: str, dimension: int) -> None:
    """Print the table of one family."""
    print(f"\n### {family}, {dimension}D\n")
    print("| step | model | at rest: error of p | speed | disorder | nearest | dam break: speed | disorder | nearest |")
    print("|---|---|---|---|---|---|---|---|---|")
    for kind in STEPS:
        for label, scheme in choices(family):
            try:
                step = kind(**{family: scheme})
            except ValueError:
                continue  # the step does not have the instants that the source reads
            still, flow = (run(step, dimension, at_rest=at_rest) for at_rest in (True, False))
            cells = [kind.key, label]
            if still.broke:
                cells += [still.broke, "", "", ""]
            else:
                cells += [f"{100 * still.error:.2f} %", number(still.speed, ".4f")]
                cells += [number(still.disorder, ".3f"), number(still.nearest, ".2f")]
            if flow.broke:
                cells += [flow.broke, "", ""]
            else:
                cells += [number(flow.speed, ".2f"), number(flow.disorder, ".3f"), number(flow.nearest, ".2f")]
            print("| " + " | ".join(cells) + " |", flush=True)


def main() -> None:
    """Print the tables asked for."""
    named.load_all()
    families = [a for a in sys.argv[1:] if a in ("gradient", "source")] or ["gradient", "source"]
    dimensions = [int(a) for a in sys.argv[1:] if a in ("2", "3")] or [2]
    for family in families:
        for dimension in dimensions:
            table(family, dimension)


if __name__ == "__main__":
    main()
