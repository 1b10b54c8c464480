"""What an initial field gives, and the field at rest."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from spume.named import Scheme

Points = NDArray[np.float64]


@dataclass(frozen=True)
class Setting:
    """What an initial field may need to know beside the points.

    Attributes:
        density: of the fluid [kg/m^3].
        gravity: uniform acceleration at the start [m/s^2], shape (d,).
        lower, upper: corners [m] of the smallest box around the fluid's shape, shape (d,).
        above: what other fluids that stand on this one add to its hydrostatic pressure at each point [Pa], shape (n,).
    """

    density: float
    gravity: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    above: NDArray[np.float64] | float = 0.0


class Initial(Scheme, family="initial", selector="kind"):
    """An initial field. A fluid may name several; displacements are chained, the rest is summed."""

    dimensions: ClassVar[tuple[int, ...]] = (2, 3)
    """Dimensions in which the field exists."""

    def displaced(self, points: Points, setting: Setting) -> Points:
        """Return where the particles that fill the shape at `points` [m] start, shape (n, d).

        Raises:
            ValueError: a displacement that the fluid cannot have.
        """
        return points

    def velocity(self, points: Points, setting: Setting) -> Points:
        """Return the velocity [m/s] at points [m], both of shape (n, d)."""
        return np.zeros_like(points)

    def pressure(self, points: Points, setting: Setting) -> NDArray[np.float64]:
        """Return the pressure [Pa] at points [m], shape (n,)."""
        return np.zeros(len(points))


class Rest(Initial, name="rest"):
    """At rest, without pressure."""
