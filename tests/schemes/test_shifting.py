"""Particle shifting: from crowded to empty places, never out of the surface."""

import numpy as np
import pytest

from arrangements import block, inside, table
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.number_density.base import Original as NumberDensity
from spume.schemes.shifting.fickian import Fickian
from spume.schemes.shifting.none import Unshifted

pytestmark = pytest.mark.usefixtures("runtime")


def shift(position, shifting=Fickian(), share=0.0, periodic=False):  # noqa: B008
    d = position.shape[1]
    half = np.abs(block(d, round(len(position) ** (1 / d)))).max() + 0.05
    lattice, particles, pairs = table(
        position, fields=(SURFACE_SHARE, *shifting_fields()), region=([-half] * d, [half] * d) if periodic else None,
        periodic=[periodic] * d, surface_share=np.broadcast_to(share, len(position)), skin=0.1,
    )  # fmt: skip
    before = particles.numpy("position")
    shifting(lattice, particles, pairs, NumberDensity(), 1.0, 0.01)
    order = np.argsort(particles.numpy("id"))
    return (particles.numpy("position") - before)[order]


def shifting_fields():
    return [field for field in Fickian.needs if field != SURFACE_SHARE]


@pytest.mark.parametrize("d", [2, 3])
def test_a_perfect_lattice_is_left_alone(d):
    assert np.abs(shift(block(d, 7), periodic=True)).max() < 1e-15


@pytest.mark.parametrize("d", [2, 3])
def test_a_crowded_row_moves_away(d):
    """A row displaced from its place in the lattice is moved back, its neighbours away from it."""
    position = block(d, 7)
    centre = np.argmin(np.linalg.norm(position, axis=1))
    position[centre, 0] += 0.03
    moved = shift(position, periodic=True)
    assert moved[centre, 0] < -1e-3
    assert np.abs(moved[centre, 1:]).max() < 1e-15
    ahead = np.argmin(np.linalg.norm(position - position[centre] - [0.07] + 0.07 * (np.arange(d) > 0), axis=1))
    assert ahead != centre
    assert moved[ahead, 0] > 0


def test_disorder_shrinks():
    position = block(2, 12, disturbance=0.3)
    for _ in range(20):
        position = position + shift(position, periodic=True)
    lattice, particles, pairs = table(position, region=([-0.6] * 2, [0.6] * 2), periodic=[True] * 2)
    number_density = NumberDensity()
    number_density(lattice, particles, pairs)
    after = particles.numpy("number_density").std()
    lattice, particles, pairs = table(
        block(2, 12, disturbance=0.3), region=([-0.6] * 2, [0.6] * 2), periodic=[True] * 2
    )
    number_density(lattice, particles, pairs)
    assert after < 0.4 * particles.numpy("number_density").std()


def test_the_largest_shift():
    position = np.array([[0.0, 0.0], [1e-3, 0.0]])
    moved = shift(position, Fickian(largest=0.07))
    assert np.linalg.norm(moved, axis=1) == pytest.approx(0.007)


def test_the_surface_is_not_pushed_out():
    """Inside the block rows at the edge would be pushed out; as surface rows they stay."""
    position = block(2, 9)
    free = shift(position)
    edge = ~inside(position, 9, reach=0.6)
    assert np.linalg.norm(free[edge], axis=1).min() > 1e-3
    assert np.abs(shift(position, share=1.0)).max() < 1e-15


def test_without_shifting_nothing_moves():
    assert not shift(block(2, 6, disturbance=0.3), Unshifted()).any()
