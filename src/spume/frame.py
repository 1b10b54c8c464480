"""Accelerations in a frame of reference: gravity, and what a moving tank's frame adds to it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spume.gravity import Gravity
from spume.motion import Motion

__all__ = ["BodyForce", "body_force"]


@dataclass(frozen=True, eq=False)
class BodyForce:
    """The acceleration uniform + gradient (x - focus) - 2 spin x u of a particle at x with velocity u.

    Attributes:
        uniform: acceleration at the focus [m/s^2], shape (d,).
        focus: a point [m], shape (d,).
        gradient: change of the acceleration with place [1/s^2], shape (d, d).
        spin: angular velocity of the frame [rad/s], shape (3,).
        gravity: gravity alone at the focus, in the frame's axes [m/s^2], shape (d,).
    """

    uniform: NDArray[np.float64]
    focus: NDArray[np.float64]
    gradient: NDArray[np.float64]
    spin: NDArray[np.float64]
    gravity: NDArray[np.float64]

    def at_rest(self, position: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the acceleration [m/s^2] of particles at rest at these places [m], shapes (n, d)."""
        return np.asarray(self.uniform + (position - self.focus) @ self.gradient.T)

    def numbers(self) -> tuple[float, ...]:
        """Return uniform, focus, gradient (row by row) and spin, filled up to three dimensions with zeros."""
        d = len(self.uniform)
        vectors, matrix = np.zeros((2, 3)), np.zeros((3, 3))
        vectors[:, :d], matrix[:d, :d] = (self.uniform, self.focus), self.gradient
        return tuple(float(x) for x in (*vectors.ravel(), *matrix.ravel(), *self.spin))


def body_force(gravity: Gravity, motion: Motion | None, t: float) -> BodyForce:
    """Return the acceleration at the time t [s] in the laboratory, or in a frame that moves.

    With x_lab = R x + s, the frame's own acceleration is subtracted in its axes (Faltinsen & Timokha 2009,
    Sect. 2.4): R^T (g - s'') - alpha x r - omega x (omega x r) - 2 omega x u, r from the centre of rotation.
    """
    g, focus = gravity.at(t), np.asarray(gravity.focus, dtype=float)
    d = len(g)
    attraction = -gravity.stiffness * np.eye(d)
    if motion is None:
        return BodyForce(g, focus, attraction, np.zeros(3), g)
    pose = motion.pose(t, d)
    centre = np.zeros(d) if motion.centre is None else np.array(motion.centre, dtype=float)
    own = g + attraction @ (pose(centre) - focus)
    downwards = pose.unturned(own)
    uniform = pose.unturned(own - motion.acceleration_at(centre[None, :], t)[0])
    frame = np.eye(3)
    frame[:d, :d] = pose.rotation
    turning = pose.rotation.T @ motion.turning(t, d) @ pose.rotation
    return BodyForce(uniform, centre, attraction - turning, frame.T @ motion.spin(t, d), downwards)
