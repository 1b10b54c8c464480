"""The number density, and the part of it that walls bring."""

import numpy as np
import pytest

from arrangements import block, offsets, table
from spume.particles import DUMMY, FLUID, WALL
from spume.schemes.number_density.base import Original

pytestmark = pytest.mark.usefixtures("runtime")


@pytest.mark.parametrize("d", [2, 3])
def test_part_that_solid_rows_bring(d):
    """Rows above a plate, disturbed: the sum of the weights of the solid rows alone, of walls and of dummies."""
    position = block(d, 6, disturbance=0.2)
    kind = np.select([position[:, -1] > 0.0, position[:, -1] > -0.12], [FLUID, WALL], DUMMY)
    lattice, particles, pairs = table(position, kind=kind)
    model = Original()
    model(lattice, particles, pairs)
    position, kind = particles.numpy("position"), particles.numpy("kind")
    r = np.linalg.norm(offsets(position), axis=-1)
    re = model.radius(lattice)
    near = (r > 0.0) & (r < re)
    w = np.where(near, model.weight.values(np.where(near, r, 0.5 * re), re), 0.0)
    rows = kind != DUMMY
    assert particles.numpy("solid_density")[rows] == pytest.approx((w * (kind != FLUID)).sum(axis=1)[rows], rel=1e-12)
    assert particles.numpy("number_density")[rows] == pytest.approx(w.sum(axis=1)[rows], rel=1e-12)
