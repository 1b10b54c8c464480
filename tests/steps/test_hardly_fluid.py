"""Rows that have a wall around them and hardly any fluid: no pressure of thousands of metres throws them off."""

import numpy as np
import pytest

import spume
import tanks
from spume.build import build
from spume.particles import FLUID

L0 = 0.003


def two_rows(device, apart):
    """Return a simulation of two rows: one pressed into a wall, the other, ``apart`` [l0] from it, flies at it."""
    case = spume.Case(
        spacing=L0, time=spume.Time(end=10.0),
        fluid=[spume.Fluid(name="water", shape=spume.Box(lower=[0.0, 0.0], upper=[2 * L0, L0]))],
        body=[spume.Wall(name="tank", shape=spume.Tank(lower=[0.0, 0.0], upper=[8 * L0, 20 * L0], open=["top"]))],
    )  # fmt: skip
    simulation = build(case, device=device, threads=1)
    simulation.advance()
    particles = simulation.particles
    one, other = np.flatnonzero(particles.numpy("kind") == FLUID)
    position, velocity = particles.numpy("position"), particles.numpy("velocity")
    position[one] = L0 * np.array([-0.17, 10.153])
    position[other] = position[one] + L0 * np.array(apart)
    velocity[one], velocity[other] = [0.45, 0.71], [-2.15, -0.09]
    particles.set("position", position)
    particles.set("velocity", velocity)
    return simulation


@pytest.mark.parametrize("apart", [(1.3, 0.0), (1.6, 0.0), (1.9, 0.0), (1.967, 0.714)])
def test_a_row_in_a_wall_and_another_that_hardly_touches_it(device, apart):
    """Their one connection is weak, what the wall asks for is not: the pressure that gave it was 1e7 Pa."""
    simulation = two_rows(device, apart)
    simulation.step(simulation.domain, 0.0, 9.1e-4, 9.1e-4)
    assert np.linalg.norm(tanks.by_id(simulation, "velocity"), axis=1).max() < 2.2
    assert np.abs(tanks.by_id(simulation, "pressure")).max() < 0.5 * 1000.0 * 2.15**2


@pytest.mark.parametrize("cells", [(8, 20), (3, 3)])
def test_rows_in_corners_are_held_by_their_fluid(device, cells):
    """Water at rest in a tank: on the lattice no row is drawn to the pressure of the surface but those on it."""
    simulation = tanks.advanced(build(tanks.column(0.025, cells), device=device, threads=1), steps=1)
    y, drawn = tanks.by_id(simulation, "position", "surface_diagonal")
    on_surface = y[:, 1] > (cells[1] - 1) * 0.025
    assert (drawn[~on_surface] == 0.0).all()
    assert (drawn[on_surface] > 0.0).all()
