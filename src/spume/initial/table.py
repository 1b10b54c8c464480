"""An initial field from a file."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import PrivateAttr
from typing_extensions import override

from spume.initial.base import Initial, Points, Setting
from spume.named import File
from spume.tables import bare, read_csv

AXES = ("x", "y", "z")
VELOCITIES = ("u", "v", "w")


class Table(Initial, name="table"):
    """Velocity and pressure interpolated linearly between the points of a CSV table.

    Outside the hull of the points the value of the nearest one is taken.
    """

    dimensions: ClassVar[tuple[int, ...]] = (2, 3)

    file: File
    """CSV file with the columns x, y (in 3D z) [m] and any of u, v, w [m/s] and p [Pa]."""

    _points: NDArray[np.float64] = PrivateAttr()
    _values: dict[str, NDArray[np.float64]] = PrivateAttr()

    @override
    def model_post_init(self, context: object) -> None:
        names, numbers = read_csv(self.file)
        columns = {bare(name): number for name, number in zip(names, numbers.T, strict=True)}
        unknown = set(columns) - {*AXES, *VELOCITIES, "p"}
        axes = [axis for axis in AXES if axis in columns]
        if unknown or axes not in (["x", "y"], ["x", "y", "z"]):
            raise ValueError(f"{self.file}: columns {', '.join(names)}; allowed: x, y and in 3D z, any of u, v, w, p")
        if not set(columns) - set(AXES):
            raise ValueError(f"{self.file}: no column of values; allowed: u, v, w, p")
        self._points = np.stack([columns[axis] for axis in axes], axis=1)
        self._values = {name: column for name, column in columns.items() if name not in AXES}
        if len(np.unique(self._points, axis=0)) != len(self._points):
            raise ValueError(f"{self.file}: a point stands twice")

    @property
    def dimension(self) -> int:
        """Dimension of the table's points."""
        return int(self._points.shape[1])

    def _interpolate(self, name: str, points: Points) -> NDArray[np.float64]:
        from scipy.interpolate import LinearNDInterpolator, NearestNDInterpolator
        from scipy.spatial import QhullError

        if name not in self._values:
            return np.zeros(len(points))
        nearest = NearestNDInterpolator(self._points, self._values[name])(points)
        try:
            linear = LinearNDInterpolator(self._points, self._values[name])(points)
        except QhullError:  # too few points, or all on a line: a profile
            spread = np.ptp(self._points, axis=0)
            axis = int(spread.argmax())
            if np.count_nonzero(spread) != 1:
                return np.asarray(nearest)
            order = self._points[:, axis].argsort()
            along = self._points[order, axis]
            return np.interp(points[:, axis], along, self._values[name][order])
        return np.where(np.isfinite(linear), linear, nearest)

    @override
    def velocity(self, points: Points, setting: Setting) -> Points:
        components = [self._interpolate(name, points) for name in VELOCITIES[: points.shape[1]]]
        return np.stack(components, axis=1)

    @override
    def pressure(self, points: Points, setting: Setting) -> NDArray[np.float64]:
        return self._interpolate("p", points)
