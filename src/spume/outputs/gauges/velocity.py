"""Gauge of the fluid's velocity at a point."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from spume.outputs.gauge import Riding
from spume.outputs.gauges.pressure import depth_in_wall, point_value
from spume.outputs.snapshot import Snapshot

_REACH = 1.5  # a point is reached if fluid is within this distance [l0]


class Velocity(Riding, name="velocity"):
    """Velocity of the fluid at a point, as of an acoustic or laser velocimeter.

    Of each component the plane is fitted to the fluid rows within 2 l0, as for the pressure: exact for linear ones.
    Walls take no part: within a spacing of one it is the velocity of the fluid that slides there. It is relative to the
    frame of the run, on a moving body in the body's axes. No fluid row within 1.5 l0: not a number.
    """

    reads: ClassVar[tuple[str, ...]] = ("position", "velocity", "kind", "to_surface")

    at: tuple[float, ...]
    """Position [m]."""

    def columns(self, dimension: int) -> dict[str, str]:
        return {"speed": "m/s"} | {f"velocity_{axis}": "m/s" for axis in "xyz"[:dimension]}

    def check(self, snapshot: Snapshot) -> None:
        super().check(snapshot)
        self.vector("at", self.at, snapshot.dimension)

    def blind(self, snapshot: Snapshot) -> str:
        """Fluid stays half a spacing off a surface: what is more than l0 behind one is reached by none."""
        depth = depth_in_wall(snapshot.around(self.at), np.asarray(self.at, dtype=float))
        if depth <= (_REACH - 0.5) * snapshot.spacing:
            return ""
        return f"lies {depth / snapshot.spacing:.2g} spacings inside a wall"

    def measure(self, snapshot: Snapshot) -> dict[str, float]:
        d = snapshot.dimension
        snapshot = snapshot.seen_from(self.body).around(self.at)
        l0, centre = snapshot.spacing, np.asarray(self.at, dtype=float)
        position = np.asarray(snapshot["position"], dtype=float)
        rows = np.flatnonzero(snapshot.fluid & np.all(np.abs(position - centre) < 2.0 * l0, axis=1))
        distance = np.linalg.norm(position[rows] - centre, axis=1)
        if not np.any(distance <= _REACH * l0):
            return dict.fromkeys(self.columns(d), float("nan"))
        u = np.asarray(snapshot["velocity"], dtype=float)[rows]
        at = [point_value(centre, position[rows], u[:, k], len(rows), l0) for k in range(d)]
        return {"speed": float(np.linalg.norm(at))} | {f"velocity_{a}": v for a, v in zip("xyz", at, strict=False)}
