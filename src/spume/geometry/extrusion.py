"""A polygon drawn out along an axis."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from typing_extensions import override

from spume.geometry.facets import Facets, first_of_nearest, prism
from spume.geometry.grid import Grid
from spume.geometry.shapes import Points, Polygon, Shape

_PLANE = {"x": (1, 2), "y": (0, 2), "z": (0, 1)}


class Extrusion(Shape, name="extrusion"):
    """A prism: a polygon drawn out along an axis (3D).

    The two numbers of a vertex are the coordinates on the other two axes, in the order x, y, z: (y, z)
    along x, (x, z) along y, (x, y) along z.
    """

    dimensions: ClassVar[tuple[int, ...]] = (3,)

    vertices: Annotated[tuple[tuple[float, float], ...], Field(min_length=3)]
    """Vertices [m] in order, either way round; the last joins the first."""
    axis: Literal["x", "y", "z"] = "y"
    """Axis along which the polygon is drawn out."""
    start: float
    """Coordinate [m] on the axis at which the prism begins."""
    end: float
    """Coordinate [m] on the axis at which it ends; greater than `start`."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.start >= self.end:
            raise ValueError(f"start = {self.start:g} must be less than end = {self.end:g}")
        self._polygon()
        return self

    def _polygon(self) -> Polygon:
        return Polygon(vertices=self.vertices)

    @property
    def _axes(self) -> tuple[list[int], int]:
        """The two axes of the polygon, and the one along which it is drawn out."""
        return list(_PLANE[self.axis]), "xyz".index(self.axis)

    @override
    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        plane, _ = self._axes
        lower, upper = np.full(3, self.start), np.full(3, self.end)
        lower[plane], upper[plane] = self._polygon().bounds()
        return lower, upper

    @override
    def nearest(self, points: Points) -> Points:
        plane, k = self._axes
        polygon = self._polygon()
        x, flat = points[:, k], points[:, plane]
        over = polygon.inside(flat)
        onto = polygon.nearest(flat)
        # On the sides: the nearest point of the outline. On the ends: that of the polygon's area.
        feet = np.repeat(points[None], 3, axis=0)
        feet[0][:, plane], feet[0][:, k] = onto, np.clip(x, self.start, self.end)
        for foot, end in ((feet[1], self.start), (feet[2], self.end)):
            foot[:, plane], foot[:, k] = np.where(over[:, None], flat, onto), end
        row = np.tile(np.arange(len(points)), 3)
        lower, upper = self.bounds()
        every = feet.reshape(-1, 3)
        return np.asarray(every[first_of_nearest(points, row, every, float((upper - lower).max()))])

    @override
    def inside(self, points: Points) -> NDArray[np.bool_]:
        plane, k = self._axes
        between = (points[:, k] > self.start) & (points[:, k] < self.end)
        return np.asarray(between & self._polygon().inside(points[:, plane]))

    @override
    def facets(self) -> Facets:
        plane, k = self._axes
        frame = np.zeros((3, 3))
        frame[0, plane[0]] = frame[1, plane[1]] = 1.0
        frame[2, k] = self.end - self.start
        return prism(np.array(self.vertices, dtype=float), self.start * np.eye(3)[k], frame)

    @override
    def measure(self) -> float:
        return self._polygon().measure() * (self.end - self.start)

    @override
    def surface(self) -> float:
        polygon = self._polygon()
        return 2.0 * polygon.measure() + polygon.surface() * (self.end - self.start)

    @override
    def snapped(self, grid: Grid) -> tuple[Self, list[str]]:
        plane, k = self._axes
        flat = Grid(tuple(grid.origin[axis] for axis in plane), grid.spacing)
        polygon, said = self._polygon().snapped(flat)
        names = dict(zip("xy", ("xyz"[axis] for axis in plane), strict=True))
        said = [names[sentence[0]] + sentence[1:] for sentence in said]
        start, end = grid.snap(self.start, k, "start", said), grid.snap(self.end, k, "end", said)
        if start >= end:
            raise ValueError(f"its {self.axis} extent is less than half a spacing of {grid.spacing:g} m")
        return self.model_copy(update={"vertices": polygon.vertices, "start": start, "end": end}), said
