"""Gravity: constant, prescribed in time, or central.

Every gravity gives the acceleration ``at(t) - stiffness (x - focus)`` [m/s^2].
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr
from pydantic_core import PydanticCustomError
from typing_extensions import override

from spume.named import File, Scheme
from spume.tables import bare, read_csv


class Gravity(Scheme, family="gravity", selector="kind"):
    """The acceleration of gravity. A bare vector stands for a constant one: ``gravity = [0.0, -9.81]``."""

    def at(self, t: float) -> NDArray[np.float64]:
        """Return the uniform part [m/s^2] at the time t [s], shape (d,)."""
        raise NotImplementedError

    @property
    def steady(self) -> bool:
        """Whether it is the same at all times."""
        return True

    @property
    def stiffness(self) -> float:
        """Strength [1/s^2] of the central part, zero without one."""
        return 0.0

    @property
    def focus(self) -> NDArray[np.float64]:
        """Point [m] where the central part vanishes, shape (d,)."""
        return np.zeros_like(self.at(0.0))

    @override
    @classmethod
    def shorthand(cls, value: Any) -> Any:
        if isinstance(value, int | float) and not isinstance(value, bool):
            raise PydanticCustomError(
                "gravity_form",
                "must be a vector such as [0.0, {down}] in 2D or [0.0, 0.0, {down}] in 3D",
                {"down": repr(-abs(float(value)))},
            )
        if isinstance(value, list | tuple) or getattr(value, "ndim", None):
            return {"kind": "constant", "vector": value}
        return super().shorthand(value)

    @override
    @classmethod
    def shorthand_schema(cls) -> list[dict[str, Any]]:
        return [{"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 3}]


class Constant(Gravity, name="constant"):
    """The same everywhere and always."""

    vector: tuple[float, ...]
    """Acceleration [m/s^2]."""

    @override
    def at(self, t: float) -> NDArray[np.float64]:
        return np.array(self.vector, dtype=float)


class Table(Gravity, name="table"):
    """The same everywhere, linear in time between the lines of a CSV file.

    Before the first and after the last line the value of that line holds.
    """

    file: File
    """CSV file with the columns time [s], x, y and in 3D z [m/s^2]."""

    _series: tuple[NDArray[np.float64], NDArray[np.float64]] = PrivateAttr()

    @property
    @override
    def steady(self) -> bool:
        return False

    @override
    def model_post_init(self, context: Any) -> None:
        names, numbers = read_csv(self.file)
        columns = [bare(name) for name in names]
        if columns not in (["time", "x", "y"], ["time", "x", "y", "z"]):
            raise ValueError(f"{self.file}: columns {', '.join(names)}; allowed: time, x, y and in 3D z")
        if np.any(np.diff(numbers[:, 0]) <= 0):
            line = int(np.argmax(np.diff(numbers[:, 0]) <= 0))
            later, earlier = numbers[line + 1, 0], numbers[line, 0]
            raise ValueError(f"{self.file}: time {later:g} s stands after {earlier:g} s; times must increase")
        self._series = numbers[:, 0], numbers[:, 1:]

    @override
    def at(self, t: float) -> NDArray[np.float64]:
        times, vectors = self._series
        return np.array([np.interp(t, times, component) for component in vectors.T])


class Central(Gravity, name="central"):
    """An attraction that grows with the distance from a centre, -strength (x - centre)."""

    strength: Annotated[float, Field(ge=0)]
    """Acceleration per distance [1/s^2]."""
    centre: tuple[float, ...]
    """Point [m] towards which everything is drawn."""

    @override
    def at(self, t: float) -> NDArray[np.float64]:
        return np.zeros(len(self.centre))

    @property
    @override
    def stiffness(self) -> float:
        return self.strength

    @property
    @override
    def focus(self) -> NDArray[np.float64]:
        return np.array(self.centre, dtype=float)
