"""A motion relative to another one."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from spume.motion.base import Motion
from spume.motion.pose import Points, Pose, cross_matrix


class Composed(Motion, name="composed"):
    """What moves by `inner` in a frame that moves by `outer`: sway and roll, or a flap in a rolling tank.

    x(t) = outer(inner(x(0))). The keys centre, axis and start are those of its two parts.
    """

    outer: Motion
    """Motion of the frame."""
    inner: Motion
    """Motion in the frame."""

    @override
    def coordinates(self, t: float, order: int = 0) -> tuple[NDArray[np.float64], float]:
        raise TypeError("two rotations about different axes have no common angle")

    @override
    def problems(self, dimension: int, end: float) -> Iterator[tuple[str, str]]:
        for key in ("centre", "axis"):
            if getattr(self, key) is not None:
                yield key, "give it to outer or inner"
        if self.start > 0.0:
            yield "start", "give it to outer or inner"
        for name, part in (("outer", self.outer), ("inner", self.inner)):
            yield from ((name, f"its {key} {message}") for key, message in part.problems(dimension, end))

    @override
    def spin(self, t: float, dimension: int, order: int = 1) -> NDArray[np.float64]:
        frame = np.eye(3)
        frame[:dimension, :dimension] = self.outer.pose(t, dimension).rotation
        relative = frame @ self.inner.spin(t, dimension, order)
        if order == 2:
            relative += np.cross(self.outer.spin(t, dimension), frame @ self.inner.spin(t, dimension))
        return self.outer.spin(t, dimension, order) + relative

    @override
    def pose(self, t: float, dimension: int) -> Pose:
        return self.outer.pose(t, dimension).after(self.inner.pose(t, dimension))

    @override
    def velocity_at(self, points: Points, t: float) -> Points:
        frame, place = self.outer.pose(t, points.shape[1]), self.inner.pose(t, points.shape[1])
        return self.outer.velocity_at(place(points), t) + frame.turned(self.inner.velocity_at(points, t))

    @override
    def acceleration_at(self, points: Points, t: float) -> Points:
        d = points.shape[1]
        frame, place = self.outer.pose(t, d), self.inner.pose(t, d)
        relative = frame.turned(self.inner.velocity_at(points, t))
        coriolis = 2.0 * relative @ cross_matrix(self.outer.spin(t, d))[:d, :d].T
        own = frame.turned(self.inner.acceleration_at(points, t))
        return self.outer.acceleration_at(place(points), t) + own + coriolis
