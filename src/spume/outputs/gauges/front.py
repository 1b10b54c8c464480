"""Gauge of the position of a front."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from spume.outputs.connected import main_body
from spume.outputs.gauge import Gauge
from spume.outputs.snapshot import Snapshot


class Front(Gauge, name="front"):
    """Position of the foremost point of the fluid along a direction e.

    X = max over the main body of x·e + l0/2: the surface lies l0/2 outside the outermost centres.
    The main body is the largest connected one (cells of size l0 that touch), so drops that fly
    ahead do not count.
    """

    reads: ClassVar[tuple[str, ...]] = ("position", "kind")

    direction: tuple[float, ...] | None = None
    """Direction e along which the front is measured, of any length [1]; default: +x."""

    def columns(self, dimension: int) -> dict[str, str]:
        return {"front": "m"}

    def check(self, snapshot: Snapshot) -> None:
        if self.direction is not None:
            e = self.vector("direction", self.direction, snapshot.dimension)
            if not np.any(e):
                raise ValueError(f"gauge {self.name!r}: direction = {list(e)}: not the zero vector")
        for axis in snapshot.periods:
            if self._along(snapshot.dimension)[axis] != 0.0:
                raise ValueError(
                    f"gauge {self.name!r}: direction has a part along {'xyz'[axis]}, where the domain is periodic and "
                    "nothing is foremost; give another direction"
                )

    def measure(self, snapshot: Snapshot) -> dict[str, float]:
        ahead = np.asarray(snapshot["position"], dtype=float)[main_body(snapshot)] @ self._along(snapshot.dimension)
        if len(ahead) == 0:
            return {"front": float("nan")}
        return {"front": float(ahead.max()) + 0.5 * snapshot.spacing}

    def _along(self, dimension: int) -> NDArray[np.float64]:
        """Return the direction, of length one."""
        e = np.eye(dimension)[0] if self.direction is None else np.asarray(self.direction, dtype=float)
        return np.asarray(e / np.linalg.norm(e))
