"""Motion at constant velocity."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from typing_extensions import override

from spume.motion.base import Motion


class Uniform(Motion, name="uniform"):
    """s = velocity t, theta = rate t: constant velocity and constant angular velocity."""

    velocity: tuple[float, ...] | None = None
    """Velocity [m/s]; default: it does not translate."""
    rate_deg: float = 0.0
    """Angular velocity [degrees/s]."""

    @property
    @override
    def turns(self) -> bool:
        return self.rate_deg != 0.0

    @override
    def coordinates(self, t: float, order: int = 0) -> tuple[NDArray[np.float64], float]:
        factor = (t, 1.0, 0.0)[order]
        return factor * np.array(self.velocity or (), dtype=float), factor * math.radians(self.rate_deg)
