"""Wall functions: the law that they stand for, the momentum that a wall takes, and what is left alone."""

import numpy as np
import pytest

from arrangements import table
from spume.particles import DUMMY, FLUID, WALL
from spume.pressure.matrix import SYSTEM_FIELDS
from spume.schemes.laplacian.distance import Distance
from spume.schemes.viscosity.explicit import Explicit
from spume.schemes.wall_function.power_law import PowerLaw
from spume.wall_models.base import WALL_FIELDS
from spume.wall_models.neumann import Neumann

pytestmark = pytest.mark.usefixtures("runtime")
CELLS, NU = 10, 1e-6
LAW = PowerLaw()


def over_a_plate(velocity, nu=NU, slip=0, speed=0.0):
    """Return (lattice, particles, pairs) of rows up to y = 1 above a plate at y = 0, periodic along it."""
    y = (np.arange(-3, CELLS) + 0.5) / CELLS
    x = (np.arange(7) + 0.5) / CELLS
    position = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    depth = np.maximum(-position[:, 1], 0.0)
    kind = np.select([depth == 0, depth < 1 / CELLS], [FLUID, WALL], DUMMY)
    fluid = (kind == FLUID)[:, None]
    along = np.broadcast_to([1.0, 0.0], position.shape)
    rows = {
        "kind": kind, "to_surface": np.stack([0 * depth, depth], axis=1), "slip": np.full(len(kind), slip),
        "wall_velocity": np.where(fluid, 0.0, speed) * along, "kinematic_viscosity": np.full(len(kind), nu),
        "master": np.arange(len(kind)) // len(y) * len(y) + 2,  # the wall row of the column
        "velocity": np.where(fluid, velocity(position[:, 1])[:, None], speed) * along,
    }  # fmt: skip
    return table(
        position, 1 / CELLS, fields=(*SYSTEM_FIELDS, *WALL_FIELDS), region=([0.0, -0.4], [7 / CELLS, 1.1]),
        periodic=[True, False], skin=0.1, **rows,
    )  # fmt: skip


def acceleration(domain, viscosity):
    lattice, particles, pairs = domain
    Neumann().show_slip(lattice, particles, pairs)
    particles.set("acceleration", np.zeros((particles.count, 2)))
    viscosity(lattice, particles, pairs, 0.01)
    fluid = particles.numpy("kind") == FLUID
    return particles.numpy("position")[fluid, 1], particles.numpy("acceleration")[fluid]


@pytest.mark.parametrize("y_plus", [40.0, 100.0, 300.0, 900.0])
def test_near_the_logarithmic_law(y_plus):
    """With the velocity of the logarithmic law at y, the stress is that law's within 4 % (2 % of the velocity)."""
    friction, y = 0.1, y_plus * NU / 0.1
    u = friction * (np.log(y_plus) / 0.41 + 5.0)
    assert LAW.values(u, y, NU) == pytest.approx(friction**2, rel=0.04)


def test_laminar_and_turbulent_branch_meet():
    """At y+ = 8.3^(7/6) = 11.81 both give the same stress; below, tau = mu u/y, above, u^(7/4)."""
    y = 0.01
    meeting = 8.3 ** (7 / 3) * NU / y
    assert LAW.values(meeting, y, NU) == pytest.approx(NU * meeting / y, rel=1e-12)
    assert LAW.values(0.5 * meeting, y, NU) == pytest.approx(NU * 0.5 * meeting / y, rel=1e-12)
    assert LAW.values(4.0 * meeting, y, NU) == pytest.approx(4.0**1.75 * NU * meeting / y, rel=1e-12)


def test_the_wall_takes_the_stress_and_nothing_else_does():
    """A plug flow: per area of the wall the rows together lose tau, that of the velocity at their distances."""
    velocity = 2.0
    domain = over_a_plate(lambda y: 0 * y + velocity)
    y, found = acceleration(domain, Explicit(laplacian=Distance(), wall_function=LAW))
    lost = -found[:, 0].sum() / CELLS**2 / (7 / CELLS)
    first, second = LAW.values(velocity, np.array([0.5, 1.5]) / CELLS, NU)
    assert second < lost < first
    assert lost == pytest.approx(first, rel=0.1)
    assert found[:, 1] == pytest.approx(0.0, abs=1e-12)
    assert found[y > 2.0 / CELLS, 0] == pytest.approx(0.0, abs=1e-12), "rows that no wall is near"


def test_the_velocity_that_counts_is_relative_to_the_wall():
    domain = over_a_plate(lambda y: 0 * y + 2.0, speed=3.0)
    _, found = acceleration(domain, Explicit(laplacian=Distance(), wall_function=LAW))
    other = over_a_plate(lambda y: 0 * y - 1.0)
    assert found == pytest.approx(acceleration(other, Explicit(laplacian=Distance(), wall_function=LAW))[1], abs=1e-12)
    assert found[:, 0].max() > 0, "it is carried along"


@pytest.mark.parametrize("law", [LAW, None])
def test_free_slip_walls_have_no_stress(law):
    viscosity = Explicit(laplacian=Distance(), **({} if law is None else {"wall_function": law}))
    _, found = acceleration(over_a_plate(lambda y: 0 * y + 2.0, slip=1), viscosity)
    assert found == pytest.approx(0.0, abs=1e-9)


def test_a_layer_that_is_resolved_is_left_as_it_is():
    """A linear profile at low Reynolds number has no viscous force, with the images as with the function."""
    nu = 0.5
    for viscosity in (Explicit(laplacian=Distance()), Explicit(laplacian=Distance(), wall_function=LAW)):
        y, found = acceleration(over_a_plate(lambda y: 1.5 * y, nu), viscosity)
        assert found[y < 0.75] == pytest.approx(0.0, abs=1e-9 * nu * CELLS**2)
