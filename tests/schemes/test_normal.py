"""The normal of the free surface of rows that lie in a line: their second moment has no inverse."""

import numpy as np
import pytest

from arrangements import table
from spume.schemes.normal import NORMAL_FIELDS, surface_normals
from spume.schemes.number_density.base import Original

pytestmark = pytest.mark.usefixtures("runtime")


@pytest.mark.parametrize("d", [2, 3])
def test_the_ends_of_a_thread_point_out_of_it(d):
    """Where B^-1 does not exist, n = -b/|b|: from the neighbours to the empty side."""
    position = np.zeros((3, d))
    position[:, 0] = [0.0, 0.1, 0.2]
    lattice, particles, pairs = table(position, fields=NORMAL_FIELDS)
    surface_normals(Original(), lattice, particles, pairs)
    found = particles.numpy("surface_normal")[np.argsort(particles.numpy("position")[:, 0])]
    expected = np.zeros((3, d))
    expected[0, 0], expected[2, 0] = -1.0, 1.0
    assert found == pytest.approx(expected, abs=1e-12)
