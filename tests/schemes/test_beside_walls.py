"""Beside a wall, what changes along it is the fluid's to say: gradient and divergence are exact for linear fields."""

import numpy as np
import pytest

from arrangements import block, inside, table
from spume.particles import DUMMY, FLUID, WALL
from spume.schemes.divergence.bounded import Bounded
from spume.schemes.gradient.imaged import Imaged
from spume.schemes.velocity_gradient import VELOCITY_GRADIENT
from spume.wall_models.neumann import Neumann

pytestmark = pytest.mark.usefixtures("runtime")
dimensions = pytest.mark.parametrize("d", [2, 3])

G = np.array([310.0, -700.0, 450.0])
DT, RHO, DISTURBED = 2e-3, 1000.0, 0.15


def beside_wall(d, inclined=True):
    """Return a disturbed block of fluid beside a solid half-space, the normal, and which fluid rows see no edge."""
    cells = 11 if d == 2 else 9
    lattice = block(d, cells)
    solid = lattice[:, -1] < -0.05
    disturbed = np.where(solid[:, None], lattice, block(d, cells, disturbance=DISTURBED))
    to_surface = np.zeros_like(lattice)
    to_surface[solid, -1] = -0.05 - lattice[solid, -1]
    core = inside(disturbed, cells, disturbance=DISTURBED)
    turn = np.eye(d)
    if inclined:
        c, s = np.cos(0.4), np.sin(0.4)
        turn[[0, 0, -1, -1], [0, -1, 0, -1]] = c, -s, s, c
    kind = np.where(solid, np.where(lattice[:, -1] > -0.15, WALL, DUMMY), FLUID)
    model, divergence = Imaged(), Bounded()
    fields = dict.fromkeys((*model.needed(), *divergence.needed(), *Neumann().needed(), VELOCITY_GRADIENT))
    handles = table(
        disturbed @ turn.T, fields=tuple(fields), kind=kind, to_surface=to_surface @ turn.T, scalar=core.astype(float)
    )
    chosen = (handles[1].numpy("scalar") > 0) & (handles[1].numpy("kind") == FLUID)
    depth = (handles[1].numpy("position") @ turn)[:, -1] + 0.05
    assert (chosen & (depth < 0.08)).sum() >= 3, "rows at the wall are among them"
    return (*handles, turn[:, -1], chosen)


@dimensions
def test_the_gradient_of_a_linear_pressure_is_exact(d):
    """The wall says G.n by the velocity with which rows approach it, and nothing of the rest of G."""
    lattice, particles, pairs, normal, chosen = beside_wall(d)
    g = G[:d]
    velocity = np.broadcast_to((g @ normal) * DT / RHO * normal, (particles.count, d)).copy()
    fluid = particles.numpy("kind") == FLUID
    velocity[~fluid] = 0.0
    particles.set("velocity", velocity)
    particles.set("answer", np.where(fluid, 5.0 + particles.numpy("position") @ g, 1e6))
    view = Neumann().view(DT, True)
    Imaged(floor=0.1)(lattice, particles, pairs, phi="answer", out="vector", view=view)
    assert particles.numpy("vector")[chosen] == pytest.approx(np.broadcast_to(g, (chosen.sum(), d)), rel=1e-9)


@dimensions
def test_a_gradient_that_takes_all_of_a_wall_takes_rest_along_it(d):
    """A model without ``of_normals`` is shown water at rest along the wall, and is exact for that pressure only."""
    lattice, particles, pairs, _normal, chosen = beside_wall(d)
    g = G[:d]
    fluid = particles.numpy("kind") == FLUID
    velocity = np.broadcast_to(g * DT / RHO, (particles.count, d)).copy()  # predicted, of the solid rows too
    particles.set("velocity", velocity)
    particles.set("answer", np.where(fluid, 5.0 + particles.numpy("position") @ g, 1e6))
    Neumann().neumann(particles, DT)
    view = Neumann().view(DT)
    assert not view.of_normals
    Imaged(floor=0.1)(lattice, particles, pairs, phi="answer", out="vector", view=view)
    assert particles.numpy("vector")[chosen] == pytest.approx(np.broadcast_to(g, (chosen.sum(), d)), rel=1e-9)


@dimensions
def test_the_divergence_of_a_flow_that_is_stretched_along_a_wall_is_exact(d):
    lattice, particles, pairs, normal, chosen = beside_wall(d)
    along = np.eye(d) - np.outer(normal, normal)
    slope = along @ np.random.default_rng(5).normal(size=(d, d)) @ along
    fluid = particles.numpy("kind") == FLUID
    particles.set("velocity", np.where(fluid[:, None], particles.numpy("position") @ slope.T, 0.0))
    for floor in (0.1, 0.2):
        Bounded(floor=floor)(lattice, particles, pairs, out="answer", mirror=True)
        assert particles.numpy("answer")[chosen] == pytest.approx(np.trace(slope), rel=1e-9)


@dimensions
def test_a_drop_that_slides_down_a_wall_falls_freely(d):
    """One row beside a wall has no fluid that could press on it: nothing holds it along the wall."""
    cells = 9
    lattice = block(d, cells)
    solid = lattice[:, -1] < -0.05
    alone = np.zeros((1, d))
    position = np.concatenate([lattice[solid], alone])
    to_surface = np.zeros_like(position)
    to_surface[:-1, -1] = -0.05 - position[:-1, -1]
    kind = np.where(np.arange(len(position)) == len(position) - 1, FLUID, WALL)
    velocity = np.tile([-9.81 * DT, *[0.0] * (d - 1)], (len(position), 1))  # the predictor accelerates all alike
    fields = dict.fromkeys((*Imaged().needed(), *Neumann().needed()))
    handles = table(position, fields=tuple(fields), kind=kind, to_surface=to_surface, velocity=velocity)
    Imaged()(*handles, phi="answer", out="vector", view=Neumann().view(DT, True))
    fluid = handles[1].numpy("kind") == FLUID
    np.testing.assert_allclose(handles[1].numpy("vector")[fluid], 0.0, atol=1e-9)
    # A model that takes all of a wall is told of water at rest along it, which would hold the drop in part.
    Neumann().neumann(handles[1], DT)
    Imaged()(*handles, phi="answer", out="vector", view=Neumann().view(DT))
    assert np.abs(handles[1].numpy("vector")[fluid][:, 0]).min() > 0.1 * RHO * 9.81


@pytest.mark.parametrize("normals", [True, False])
def test_what_flows_around_a_round_body_is_not_driven_along(normals):
    """Fluid that turns around a disk has a pressure's gradient across its way: none that makes it faster."""
    l0, radius = 0.1, 4.0
    lattice = block(2, 17)
    r = np.linalg.norm(lattice, axis=1)
    solid = r < radius * l0
    kind = np.where(solid, np.where(r > (radius - 1) * l0, WALL, DUMMY), FLUID)
    to_surface = np.where(solid[:, None], lattice / np.maximum(r, 1e-9)[:, None] * (radius * l0 - r)[:, None], 0.0)
    model = Imaged(normals=normals)
    fields = dict.fromkeys((*model.needed(), *Neumann().needed()))
    handles = table(lattice, fields=tuple(fields), kind=kind, to_surface=to_surface)
    lattice_, particles, pairs = handles
    x = particles.numpy("position")
    along = np.stack([-x[:, 1], x[:, 0]], axis=1) / np.maximum(np.linalg.norm(x, axis=1), 1e-9)[:, None]
    fluid = particles.numpy("kind") == FLUID
    particles.set("velocity", np.where(fluid[:, None], 4.0 * along, 0.0))
    particles.set("density", np.full(len(x), RHO))
    particles.set("answer", np.zeros(len(x)))
    Neumann().neumann(particles, DT)
    model(lattice_, particles, pairs, phi="answer", out="vector", view=Neumann().view(DT, model.of_normals))
    beside = fluid & (np.linalg.norm(x, axis=1) < (radius + 1.0) * l0)
    change = -DT / RHO * np.einsum("ij,ij->i", particles.numpy("vector"), along)
    assert beside.sum() > 20
    assert np.abs(change[beside].mean()) < 0.01 * 4.0
