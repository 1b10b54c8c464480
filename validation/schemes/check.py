"""Every gradient model and every source, in every step that takes it: water at rest and a dam break, both coarse.

python validation/schemes/check.py [--write]

One slot is changed, all others are the step's defaults, but where a gradient needs a known pressure at the surface:
there the free surface is `blended`. With --write the tables in docs/schemes-measured.md are replaced.
"""

import logging
import math
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

import spume
from spume import named
from spume.build import build
from spume.named import Scheme
from spume.outputs.snapshot import Snapshot
from spume.particles import FLUID
from spume.schemes.free_surface.blended import Blended
from spume.schemes.gradient.cmps import Conservative
from spume.schemes.gradient.stabilised import Stabilised
from spume.simulation import Diverged
from spume.steps.base import Step
from spume.steps.predict_move_project import PredictMoveProject
from spume.steps.project_in_place import ProjectInPlace

G, RHO = 9.81, 1000.0
STEPS: tuple[type[Step], ...] = (ProjectInPlace, PredictMoveProject)
REST_STEPS, BREAK_STEPS = 100, 200
PAGE = Path(__file__).parents[2] / "docs" / "schemes-measured.md"
HEAD = "| step | model | at rest: error of p | speed | disorder | nearest | dam break: speed | disorder | nearest |"


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
    scatter = float(np.sqrt(np.mean(np.square(uneven)))) if uneven else math.nan
    return l0 * d / n0 * scatter, float(pairs[:, 1].min() / l0)


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


def built(kind: type[Step], family: str, scheme: Scheme) -> Step | None:
    """Return the step with that scheme; nothing where it does not have the instants that the scheme reads."""
    try:
        step: Any = kind(**{family: scheme})
        fits = step.free_surface.known or step.gradient.completes
        return step if fits else kind(**{family: scheme, "free_surface": Blended()})
    except ValueError:
        return None


def table(family: str, dimension: int) -> str:
    """Print the table of one family, row by row, and return it."""
    lines = [HEAD, "|---" * HEAD.count(" |") + "|"]
    print(f"\n### {family}, {dimension}D\n\n" + "\n".join(lines))
    for kind in STEPS:
        for label, scheme in choices(family):
            if (step := built(kind, family, scheme)) is None:
                continue
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
            lines.append("| " + " | ".join(cells) + " |")
            print(lines[-1], flush=True)
    return "\n".join(lines)


def main() -> None:
    """Print the tables; write them into the documentation where asked for."""
    named.load_all()
    logging.getLogger("spume").setLevel(logging.ERROR)  # what a model is warned of is what the tables show
    page = PAGE.read_text(encoding="utf-8")
    for family in ("gradient", "source"):
        for dimension in (2, 3):
            found = table(family, dimension)
            marks = rf"(## {family.capitalize()}s, {dimension}D\n\n)\|.*?(?=\n\n)"
            page = re.sub(marks, lambda m, found=found: m[1] + found, page, flags=re.S)
    if "--write" in sys.argv:
        PAGE.write_text(page, encoding="utf-8")


if __name__ == "__main__":
    main()
