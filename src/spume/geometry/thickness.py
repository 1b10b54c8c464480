"""How thick a plate is between its two faces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from spume.geometry.shapes import Points, Shape

_PARALLEL = -0.99  # product of the normals of two faces that belong to a plate
_HALVINGS = 40


def other_face(
    shape: Shape, face: Points, normal: Points, thickness: float
) -> tuple[NDArray[np.float64], Points, NDArray[np.bool_]]:
    """Return, for points of a shape's surface, how far it is through the shape to a parallel face.

    Args:
        shape: the solid.
        face: points of its surface [m], shape (n, d).
        normal: unit vectors that look out of the solid there, shape (n, d).
        thickness: what is looked for is nearer than this [m].

    Returns:
        The distance [m], shape (n,), the point of the other face [m], shape (n, d), and where there is one: not at
        the tip of a wedge, whose faces are not parallel, nor where the solid is thicker.
    """
    inside = shape.inside(face - 1e-6 * thickness * normal)
    thin = inside & ~shape.inside(face - (1.0 - 1e-6) * thickness * normal)
    near, far = np.full(len(face), 1e-6 * thickness), np.full(len(face), thickness)
    for _ in range(_HALVINGS):
        middle = 0.5 * (near + far)
        within = shape.inside(face - middle[:, None] * normal)
        near, far = np.where(within, middle, near), np.where(within, far, middle)
    beyond = face - (far + 1e-3 * thickness)[:, None] * normal
    away = beyond - shape.nearest(beyond)
    length = np.maximum(np.linalg.norm(away, axis=1), 1e-300)
    thin &= np.einsum("ij,ij->i", away, normal) / length < _PARALLEL
    return far, face - far[:, None] * normal, thin
