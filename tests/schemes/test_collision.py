"""Collisions of near pairs: momentum, restitution, and what is left alone."""

import numpy as np
import pytest

from arrangements import block, table
from spume import named
from spume.particles import FLUID, WALL
from spume.schemes import discover
from spume.schemes.collision.inelastic import Inelastic

discover()
pytestmark = pytest.mark.usefixtures("runtime")
DT = 0.01


def collide(position, velocity, collision=Inelastic(), **rows):  # noqa: B008
    lattice, particles, pairs = table(position, fields=Inelastic.needs, velocity=velocity, **rows)
    collision(lattice, particles, pairs, DT)
    order = np.argsort(particles.numpy("id"))
    return tuple(particles.numpy(n)[order] for n in ("velocity", "position", "collisions"))


@pytest.mark.parametrize("restitution", [0.0, 0.2, 1.0])
def test_a_pair_that_approaches(restitution):
    """The approach speed v becomes -e v; both the velocity and this step's move change."""
    position = np.array([[0.0, 0.0], [0.03, 0.04]])
    normal = np.array([0.6, 0.8])
    velocity = np.array([2.0 * normal + [0.8, -0.6], -1.0 * normal])
    u, x, count = collide(position, velocity, Inelastic(distance=0.6, restitution=restitution))
    assert (u[1] - u[0]) @ normal == pytest.approx(3.0 * restitution)
    assert u.sum(axis=0) == pytest.approx(velocity.sum(axis=0))
    assert (u[0] - velocity[0]) @ [0.8, -0.6] == pytest.approx(0.0), "nothing happens along the contact"
    assert x == pytest.approx(position + DT * (u - velocity))
    assert list(count) == [1, 1]


def test_what_recedes_or_is_far_is_left_alone():
    position = np.array([[0.0, 0.0], [0.03, 0.0], [1.0, 0.0], [1.06, 0.0]])
    velocity = np.array([[-1.0, 0.0], [1.0, 0.0], [1.0, 0.0], [-1.0, 0.0]])
    u, x, count = collide(position, velocity)
    assert np.array_equal(u, velocity)
    assert np.array_equal(x, position)
    assert not count.any()


def test_a_solid_row_is_infinitely_heavy():
    position = np.array([[0.0, 0.0], [0.0, -0.04]])
    velocity = np.array([[1.0, -2.0], [0.0, 0.0]])
    facing = np.array([[0.0, 0.0], [0.0, 0.05]])
    collision = Inelastic(restitution=0.5)
    u, _, _ = collide(position, velocity, collision, kind=np.array([FLUID, WALL]), to_surface=facing)
    assert u == pytest.approx(np.array([[1.0, 1.0], [0.0, 0.0]]))


@pytest.mark.parametrize("along", np.linspace(0.0, 0.1, 7))
@pytest.mark.parametrize("d", [2, 3])
def test_a_wall_has_no_gaps(d, along):
    """Spray is thrown back as by a plane wherever it hits a wall of rows, also between them; from the face on."""
    line = 0.1 * np.arange(-3, 4)
    wall = np.stack(np.meshgrid(*[line] * (d - 1), [-0.05]), axis=-1).reshape(-1, d)
    kind = np.array([FLUID, *[WALL] * len(wall)])
    facing = np.zeros((len(kind), d))
    facing[1:, -1] = 0.05
    velocity = np.zeros((len(kind), d))
    velocity[0] = [1.0, 0.5, -2.0][-d:] if d == 3 else [1.0, -2.0]
    expected = velocity[0] * ([1.0] * (d - 1) + [-0.2])
    for height, after in ((-0.01, expected), (0.01, velocity[0])):
        place = np.array([[along] * (d - 1) + [height]])
        u, _, _ = collide(np.concatenate([place, wall]), velocity, kind=kind, to_surface=facing)
        assert u[0] == pytest.approx(after, abs=1e-12)


@pytest.mark.parametrize("behind", [0.05, 0.08, 0.15])
def test_what_falls_on_the_rim_of_a_wall_is_stopped(behind):
    """Rows of a wall whose face looks to the left; spray that went over its top falls on it."""
    height, depth = np.meshgrid(-0.1 * np.arange(4), 0.1 * np.arange(3), indexing="ij")
    wall = np.stack([0.05 + depth, height], axis=-1).reshape(-1, 2)
    facing = np.zeros((len(wall) + 1, 2))
    facing[1:, 0] = -wall[:, 0]
    velocity = np.zeros((len(wall) + 1, 2))
    velocity[0] = [0.0, -2.0]
    position = np.concatenate([[[behind, 0.035]], wall])
    u, _, count = collide(position, velocity, kind=np.array([FLUID, *[WALL] * len(wall)]), to_surface=facing)
    assert u[0, 1] > -1.5
    assert count[0] > 0


def test_different_densities():
    position = np.array([[0.0, 0.0], [0.04, 0.0]])
    velocity = np.array([[1.0, 0.0], [0.0, 0.0]])
    density = np.array([1000.0, 1.0])
    u, _, _ = collide(position, velocity, Inelastic(restitution=0.0), density=density)
    assert density @ u == pytest.approx(density @ velocity)
    assert u[0] == pytest.approx(u[1])


@pytest.mark.parametrize("key", [s.key for s in named.schemes("collision") if "momentum" in s.conserves])
@pytest.mark.parametrize("d", [2, 3])
def test_momentum(key, d):
    """Conserved where it is claimed, with many pairs at once."""
    collision = {s.key: s for s in named.schemes("collision")}[key]()
    position = block(d, 6) * 0.4
    velocity = np.random.default_rng(2).normal(size=position.shape)
    u, _, count = collide(position, velocity, collision)
    if key != "none":
        assert count.sum() > 50
        assert np.abs(u - velocity).max() > 0.1
    assert u.sum(axis=0) == pytest.approx(velocity.sum(axis=0), rel=1e-12)


def test_a_pair_that_has_passed_each_other_met():
    """Towards each other by three spacings in a step: they end where they would have, had they met at the start."""
    velocity = np.array([[1.5, 0.0], [-1.5, 0.0]]) * 0.1 / DT
    start = np.array([[0.0, 0.0], [0.13, 0.0]])
    position = start + DT * velocity
    assert 0.0 < position[0, 0] - position[1, 0] < 0.5 * 0.1 * 5
    position[1, 0] = position[0, 0] - 0.02
    u, x, count = collide(position, velocity, Inelastic(restitution=0.0))
    assert u == pytest.approx(np.zeros((2, 2)), abs=1e-12)
    assert x[1, 0] > x[0, 0], "each is on its own side again"
    assert count.tolist() == [1, 1]
