"""Bodies that move as prescribed: their rows follow the motion exactly."""

import math
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field as Parameter
from typing_extensions import override

from spume import kernels
from spume.bodies.base import Body
from spume.geometry import Shape
from spume.motion import Motion, Pose
from spume.pairs import row_map, row_term
from spume.particles import SOLID, Field

MOTION_FIELDS = (
    Field("start_position", ("d",), "m", "solid rows: position at the start", constant=True, restart=True),
    Field("start_to_surface", ("d",), "m", "solid rows: to_surface at the start", constant=True, restart=True),
)


@row_term(reads=("body", "now", "start"))
def image_of_start(a, body, xx, xy, xz, yx, yy, yz, zx, zy, zz, sx, sy, sz):  # type: ignore[no-untyped-def]
    """Return matrix start + shift for the rows of one body."""
    matrix = kernels.qd.Matrix([[xx, xy, xz], [yx, yy, yz], [zx, zy, zz]])
    shift = kernels.qd.Vector([sx, sy, sz])
    result = a.now
    if a.body == body:
        for k in kernels.static(range(result.n)):
            total = shift[k]
            for m in kernels.static(range(result.n)):
                total += matrix[k, m] * a.start[m]
            result[k] = total
    return result


class Rigid(Body):
    """A body of given shape that rests or moves by a prescribed motion.

    Its rows are where the motion puts them, computed at every step from where they started; their velocity
    over a step is (x(t + dt) - x(t))/dt, so that the projection sees the wall's mean velocity and the wall
    arrives where it should.
    """

    motion_fields: ClassVar[tuple[Field, ...]] = MOTION_FIELDS
    """Fields of the table that a body in motion needs."""

    shape: Shape
    """Shape of the wall, or of the room that a container encloses."""
    motion: Motion | None = None
    """How it moves; default: it rests, or moves with the tank if the domain has a motion."""
    until: Annotated[float, Parameter(gt=0.0)] | None = None
    """Time at which the body is taken away [s]; default: never."""

    def present(self, t: float) -> bool:
        """Return whether the body is there during a step that begins at the time t [s]."""
        return self.until is None or t < self.until * (1.0 - 1e-12)

    @override
    def pose(self, t: float, dimension: int) -> Pose | None:
        return None if self.motion is None else self.motion.pose(t, dimension)

    @override
    def prescribe(self, particles: Any, t: float, dt: float) -> None:
        if not self.present(t):
            particles.remove(particles.numpy("body") == particles.bodies.index(self.name))
        elif self.motion is not None:
            now = self.motion.pose(t, particles.dimension)
            then = self.motion.pose(t + dt, particles.dimension)
            change, shift = (then.rotation - now.rotation) / dt, (then.shift - now.shift) / dt
            self._write(particles, "wall_velocity", "start_position", change, shift)

    @override
    def move(self, particles: Any, t: float) -> None:
        if self.motion is not None and self.present(t):
            pose = self.motion.pose(t, particles.dimension)
            self._write(particles, "position", "start_position", pose.rotation, pose.shift)
            if self.motion.turns:
                self._write(particles, "to_surface", "start_to_surface", pose.rotation, np.zeros_like(pose.shift))

    @override
    def max_dt(self, t: float, spacing: float) -> float:
        if self.motion is None or not self.present(t):
            return math.inf
        lower, upper = self.shape.bounds()
        corners = np.stack(np.meshgrid(*zip(lower, upper, strict=True)), axis=-1).reshape(-1, len(lower))
        speed = np.linalg.norm(self.motion.velocity_at(corners, t), axis=1).max()
        change = np.linalg.norm(self.motion.acceleration_at(corners, t), axis=1).max()
        limits = (spacing / speed if speed > 0 else math.inf, math.sqrt(spacing / change) if change > 0 else math.inf)
        return float(min(limits))

    def _write(
        self, particles: Any, now: str, start: str, matrix: NDArray[np.float64], shift: NDArray[np.float64]
    ) -> None:
        """Write matrix start + shift into a field of the body's own rows."""
        d = particles.dimension
        full, more = np.zeros((3, 3)), np.zeros(3)
        full[:d, :d], more[:d] = matrix, shift
        row_map(
            image_of_start, particles, out=now, rows=SOLID, fields={"now": now, "start": start},
            arguments=(float(particles.bodies.index(self.name)), *map(float, full.ravel()), *map(float, more)),
            dry=True,
        )  # fmt: skip
