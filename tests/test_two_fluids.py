"""Fluids of different densities: the acceleration that the matrix was solved for is the one that rows are given."""

import numpy as np
import pytest

import spume
from spume.particles import FLUID
from spume.schemes.gradient.sum import Sum
from spume.schemes.laplacian.corrected_vector import CorrectedVector
from spume.schemes.laplacian.distance import Distance
from spume.steps.predict_move_project import PredictMoveProject
from spume.steps.project_in_place import ProjectInPlace
from spume.wall_models.resting import Resting
from tanks import advanced, by_id, drop

L0, WATER = 0.025, 1000.0


def layers(upper, step=None, lighter_first=False):
    """Return the case of ten rows of another liquid over ten rows of water, at rest."""
    width, half = 8 * L0, 10 * L0
    fluids = [
        spume.Fluid(name="water", density=WATER, shape=spume.Box(lower=[0.0, 0.0], upper=[width, half])),
        spume.Fluid(name="upper", density=upper, shape=spume.Box(lower=[0.0, half], upper=[width, 2 * half])),
    ]
    tank = spume.Tank(lower=[0.0, 0.0], upper=[width, 3 * half], open=["top"])
    return spume.Case(
        spacing=L0, time=spume.Time(end=10.0), fluid=fluids[::-1] if lighter_first else fluids,
        body=[spume.Wall(name="tank", shape=tank)], step=step or ProjectInPlace(),
    )  # fmt: skip


def at_rest(upper, y):
    """Return the pressure of the layers at rest [Pa]."""
    half = 10 * L0
    return 9.81 * np.where(y < half, upper * half + WATER * (half - y), upper * (2 * half - y))


def build(case, device):
    return case.build(device=device, threads=1, precision="double")


@pytest.mark.parametrize("lighter_first", [False, True])
@pytest.mark.parametrize("upper", [900.0, 100.0, 1.0])
def test_layers_stay_at_rest(device, upper, lighter_first):
    """Half a second of them: the pressure within 0.5 % of the largest, hardly any motion, also of air over water."""
    simulation = advanced(build(layers(upper, lighter_first=lighter_first), device), until=0.5)
    x, p, u = by_id(simulation, "position", "pressure", "velocity")
    exact = at_rest(upper, x[:, 1])
    assert np.sqrt(np.mean((p - exact) ** 2)) < 0.005 * exact.max()
    assert np.abs(u).max() < 0.06 * np.sqrt(9.81 * L0)


@pytest.mark.parametrize(
    "step",
    [
        ProjectInPlace(laplacian=Distance()),
        ProjectInPlace(laplacian=CorrectedVector(base="distance")),
        ProjectInPlace(wall_model=Resting()),
        PredictMoveProject(),
    ],
    ids=["distance", "full", "resting", "predict-move-project"],
)
def test_with_other_models_too(device, step):
    simulation = advanced(build(layers(100.0, step), device), until=0.1)
    x, p = by_id(simulation, "position", "pressure")
    floor = x[:, 1] < L0
    # Rows of resting walls have the density of one fluid, and swing in.
    allowed = 0.1 if step.wall_model == Resting() else 0.02
    assert p[floor].mean() == pytest.approx(at_rest(100.0, x[floor, 1]).mean(), rel=allowed)


def test_the_surface_has_the_pressure_of_its_own_fluid(device):
    """Of water over air the surface is water's, whichever fluid comes first."""
    found = {}
    for first in ("water", "air"):
        fluids = {
            "water": spume.Fluid(name="water", density=WATER, shape=spume.Box(lower=[0.0, 0.0], upper=[0.2, 0.2])),
            "air": spume.Fluid(name="air", density=1.0, shape=spume.Box(lower=[0.4, 0.0], upper=[0.6, 0.2])),
        }
        tank = spume.Tank(lower=[0.0, 0.0], upper=[0.2, 0.4], open=["top"])
        other = spume.Tank(lower=[0.4, 0.0], upper=[0.6, 0.4], open=["top"])
        case = spume.Case(
            spacing=L0, time=spume.Time(end=1.0), step=PredictMoveProject(surface_pressure="half-cell"),
            fluid=[fluids.pop(first), *fluids.values()],
            body=[spume.Wall(name="tank", shape=tank), spume.Wall(name="other", shape=other)],
        )  # fmt: skip
        simulation = advanced(build(case, device), steps=20)
        x, value = by_id(simulation, "position", "surface_value")
        found[first] = value[x[:, 0] < 0.2].max()
    assert found["air"] == pytest.approx(found["water"], rel=1e-6)
    assert found["water"] > 0.4 * WATER * 9.81 * L0


def test_equal_and_opposite_forces_across_an_interface(device):
    """With the gradient ``sum`` a drop of two liquids keeps its momentum, whatever pressures its rows are given."""
    step = ProjectInPlace(gradient=Sum())
    simulation = build(drop(step=step, gravity=(0.0, 0.0), fluid={"disturbance": 0.2}), device)
    particles = simulation.particles
    assert np.all(particles.numpy("kind") == FLUID)
    simulation.domain.pairs.update(particles)
    rng = np.random.default_rng(3)
    x = particles.numpy("position")
    density = np.where(x[:, 0] > 0.0, 1000.0, 10.0)
    particles.set("density", density)
    particles.set("pressure", rng.uniform(100.0, 900.0, particles.count))
    view = step.wall_model.view(1.0)
    step.gradient(simulation.domain.lattice, particles, simulation.domain.pairs, view=view)
    force = particles.numpy("pressure_gradient")
    assert np.abs(force.sum(axis=0)).max() < 1e-9 * np.abs(force).sum()
