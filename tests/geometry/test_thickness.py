"""The distance through a solid to a parallel face."""

import numpy as np
import pytest

from spume.geometry import Box, Polygon, Sphere
from spume.geometry.thickness import other_face


def test_a_plate_is_as_thick_as_it_is():
    plate = Box(lower=(0.0, 0.0), upper=(0.2, 3.0))
    face, normal = np.array([[0.0, 1.0], [0.2, 2.0], [0.1, 3.0]]), np.array([[-1.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    across, there, thin = other_face(plate, face, normal, 0.5)
    assert thin.tolist() == [True, True, False], "along its length it is thick"
    assert across[:2] == pytest.approx(0.2, abs=1e-6)
    assert there[:2] == pytest.approx(np.array([[0.2, 1.0], [0.0, 2.0]]), abs=1e-6)
    assert not other_face(plate, face, normal, 0.2)[2].any(), "as thick as asked for is enough"


def test_an_inclined_plate():
    along, normal = np.array([0.8, 0.6]), np.array([-0.6, 0.8])
    corners = [a * along + b * normal for a, b in ((0.0, 0.0), (2.0, 0.0), (2.0, 0.1), (0.0, 0.1))]
    plate = Polygon(vertices=tuple(map(tuple, np.array(corners).tolist())))
    across, _, thin = other_face(plate, np.array([along + 0.1 * normal]), normal[None, :], 0.3)
    assert thin.all()
    assert across == pytest.approx(0.1, abs=1e-6)


def test_a_wedge_and_a_ball_are_no_plates():
    wedge = Polygon(vertices=((0.0, 0.0), (1.0, 0.0), (1.0, 0.5)))
    face, normal = np.array([[0.1, 0.0]]), np.array([[0.0, -1.0]])
    assert not other_face(wedge, face, normal, 0.3)[2].any()
    ball = Sphere(centre=(0.0, 0.0), radius=0.2)
    assert not other_face(ball, np.array([[0.2, 0.0]]), np.array([[1.0, 0.0]]), 0.3)[2].any()
