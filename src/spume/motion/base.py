"""The family of prescribed motions: a displacement and an angle as functions of time."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spume.motion.pose import Points, Pose, cross_matrix, rotation
from spume.named import Scheme


class Motion(Scheme, family="motion", selector="kind"):
    """A rigid motion that the flow does not change.

    x(t) = c + s(t) + R(theta(t)) (x(0) - c) with the displacement s and the angle theta about the centre c.
    Both are measured from the start, s(0) = 0 and theta(0) = 0: everything is at t = 0 where the case puts
    it. Angles count anticlockwise: from x to y, in 3D seen from the tip of `axis`.
    """

    centre: tuple[float, ...] | None = None
    """Point about which it turns, where that is at the start [m]; default: the origin of coordinates."""
    axis: tuple[float, ...] | None = None
    """Axis about which it turns (3D) [1]; default: y, as for roll in the x-z plane."""
    start: Annotated[float, Field(ge=0.0)] = 0.0
    """Time at which the motion begins [s]."""

    @abstractmethod
    def coordinates(self, t: float, order: int = 0) -> tuple[NDArray[np.float64], float]:
        """Return displacement [m] and angle [rad] a time t after the motion began, or a derivative of them.

        Args:
            t: time since `start`, at least zero [s].
            order: 0, or 1 and 2 for the first and second derivative in time (from above).

        Returns:
            A vector, shape (d,), of which the last components may be left out where they are zero, and a number.

        Raises:
            TypeError: a composed motion, whose rotations have no common angle.
        """

    @property
    def turns(self) -> bool:
        """Whether the motion rotates."""
        return True

    def problems(self, dimension: int, end: float) -> Iterator[tuple[str, str]]:
        """Yield key and message of what does not fit a case of this dimension that ends at this time [s]."""
        if self.axis is not None and dimension == 2:
            yield "axis", "exists in 3D only: in 2D everything turns about z"
        if self.axis is not None and not np.any(self.axis):
            yield "axis", "must not be the zero vector"

    def _state(self, t: float, order: int, dimension: int) -> tuple[NDArray[np.float64], float]:
        """Return displacement and angle at the time t, measured from the start."""
        if t < self.start:
            return np.zeros(dimension), 0.0
        shift, angle = self.coordinates(t - self.start, order)
        if order == 0:
            first_shift, first_angle = self.coordinates(0.0)
            shift, angle = shift - first_shift, angle - first_angle
        return np.concatenate([shift, np.zeros(dimension - len(shift))]), angle

    def _centre(self, dimension: int) -> NDArray[np.float64]:
        return np.zeros(dimension) if self.centre is None else np.array(self.centre, dtype=float)

    def _axis(self, dimension: int) -> NDArray[np.float64]:
        if dimension == 2:
            return np.array([0.0, 0.0, 1.0])
        axis = np.array([0.0, 1.0, 0.0] if self.axis is None else self.axis, dtype=float)
        return axis / float(np.linalg.norm(axis))

    def pose(self, t: float, dimension: int) -> Pose:
        """Return where the body is at the time t [s]."""
        shift, angle = self._state(t, 0, dimension)
        matrix, centre = rotation(self._axis(dimension), angle, dimension), self._centre(dimension)
        return Pose(matrix, centre + shift - matrix @ centre)

    def spin(self, t: float, dimension: int, order: int = 1) -> NDArray[np.float64]:
        """Return the angular velocity [rad/s] (order 2: acceleration), always of shape (3,)."""
        return self._state(t, order, dimension)[1] * self._axis(dimension)

    def velocity_at(self, points: Points, t: float) -> Points:
        """Return the velocity [m/s] of points of the body, given by where they started, shape (n, d)."""
        d = points.shape[1]
        arm = self.pose(t, d).turned(points - self._centre(d))
        turning = cross_matrix(self.spin(t, d))[:d, :d]
        return self._state(t, 1, d)[0] + arm @ turning.T

    def acceleration_at(self, points: Points, t: float) -> Points:
        """Return the acceleration [m/s^2] of points of the body, given by where they started, shape (n, d)."""
        d = points.shape[1]
        arm = self.pose(t, d).turned(points - self._centre(d))
        return self._state(t, 2, d)[0] + arm @ self.turning(t, d).T

    def turning(self, t: float, dimension: int) -> NDArray[np.float64]:
        """Return [alpha x] + [omega x]^2 [1/s^2]: times an arm, the acceleration of its tip; shape (d, d)."""
        spin = cross_matrix(self.spin(t, dimension))
        change = cross_matrix(self.spin(t, dimension, order=2))
        return (change + spin @ spin)[:dimension, :dimension]
