"""Where a rigid body is: a rotation and a shift."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pose:
    """Takes the points of a body from where they started to where they are, x = R x_start + s.

    Attributes:
        rotation: R, shape (d, d), orthogonal.
        shift: s [m], shape (d,).
    """

    rotation: NDArray[np.float64]
    shift: NDArray[np.float64]

    @classmethod
    def identity(cls, dimension: int) -> Self:
        """Return the pose at the start."""
        return cls(np.eye(dimension), np.zeros(dimension))

    def __call__(self, points: Points) -> Points:
        """Return where points [m] that started at these places are, shape (n, d)."""
        return points @ self.rotation.T + self.shift

    def turned(self, vectors: Points) -> Points:
        """Return vectors of the body, shape (n, d), as they are now."""
        return vectors @ self.rotation.T

    def origin(self, points: Points) -> Points:
        """Return where points [m] of the body started, shape (n, d): its coordinates in the body."""
        return (points - self.shift) @ self.rotation

    def unturned(self, vectors: Points) -> Points:
        """Return vectors, shape (n, d), in the body's axes."""
        return vectors @ self.rotation

    def after(self, inner: Pose) -> Pose:
        """Return this pose applied after another one."""
        return Pose(self.rotation @ inner.rotation, self.rotation @ inner.shift + self.shift)


def rotation(axis: NDArray[np.float64], angle: float, dimension: int) -> NDArray[np.float64]:
    """Return the matrix, shape (d, d), that turns by an angle [rad] about a unit axis, anticlockwise from its tip."""
    cross = cross_matrix(axis)
    full: NDArray[np.float64] = np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    return full[:dimension, :dimension]


def cross_matrix(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the matrix of v x, shape (3, 3)."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
