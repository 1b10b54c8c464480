"""Shapes combined: union, difference and intersection."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from typing_extensions import override

from spume.geometry.facets import Facets, first_of_nearest
from spume.geometry.grid import Grid
from spume.geometry.shapes import Points, Shape, Tank
from spume.named import OneOrMore

Shapes = Annotated[tuple[Shape, ...], OneOrMore(), Field(min_length=1)]
_ASIDE = (0.5257, 0.6180, 0.5845)  # along no face that anybody would draw


class Combined(Shape):
    """What combinations of shapes share.

    A point's distance is that of the nearest point of its parts' surfaces if that is part of the
    combined surface, which the inside on either side of it tells; so flat faces are as exact as those of
    the parts. Near the seams, where it is not, the nearest point of the combined surface is found on
    triangles (2D: segments), which follow a curved part to 2e-4 of its radius.
    """

    operation: ClassVar[str] = ""

    def parts(self) -> tuple[Shape, ...]:
        """Return all shapes that are combined."""
        raise NotImplementedError

    @model_validator(mode="after")
    def _check_parts(self) -> Self:
        if any(isinstance(part, Tank) for part in self.parts()):
            raise ValueError('a tank is a container and cannot be combined; use the shape "box"')
        dimensions = sorted({len(part.bounds()[0]) for part in self.parts()})
        if len(dimensions) > 1:
            raise ValueError("some of its shapes are two-dimensional, some three-dimensional")
        return self

    @override
    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return self.facets().bounds()

    @override
    def facets(self) -> Facets:
        return _facets(self)

    @override
    def measure(self) -> float:
        return self.facets().measure()

    @override
    def surface(self) -> float:
        return self.facets().surface()

    def _size(self) -> float:
        corners = np.array([part.bounds() for part in self.parts()])
        return float((corners[:, 1].max(axis=0) - corners[:, 0].min(axis=0)).max())

    @override
    def nearest(self, points: Points) -> Points:
        parts = self.parts()
        feet = np.concatenate([part.nearest(points) for part in parts])
        row = np.tile(np.arange(len(points)), len(parts))
        size = self._size()
        result = feet[first_of_nearest(points, row, feet, size)]
        hidden = ~self._on_surface(points, result, 1e-7 * size)
        if hidden.any():
            result[hidden] = self.facets().nearest(points[hidden])
        return np.asarray(result)

    def _on_surface(self, points: Points, feet: Points, step: float) -> NDArray[np.bool_]:
        """Return which feet lie on the combined surface: just beyond one the inside ends, or begins."""
        away = feet - points
        gap = np.linalg.norm(away, axis=1, keepdims=True)
        far = gap[:, 0] > 4.0 * step
        away = away / np.where(far[:, None], gap, 1.0)
        result = np.zeros(len(points), dtype=bool)
        before, beyond = feet[far] - step * away[far], feet[far] + step * away[far]
        result[far] = self.inside(before) != self.inside(beyond)
        near = feet[~far]  # the point is the foot itself: look to all sides
        sides = [self.inside(near + s * step * np.eye(near.shape[1])[k]) for k in range(near.shape[1]) for s in (-1, 1)]
        result[~far] = np.any(sides, axis=0) & ~np.all(sides, axis=0)
        return result

    @override
    def distance_within(self, points: Points, reach: float) -> NDArray[np.float64]:
        lowest = np.full(len(points), np.inf)
        for part in self.parts():
            np.minimum(lowest, np.abs(part.distance_within(points, reach)), out=lowest)
        result = np.where(self.inside(points), -np.inf, np.inf)
        near = lowest < reach
        result[near] = self.distance(points[near])
        return result


class Union(Combined, name="union"):
    """All that lies in at least one of some shapes."""

    operation: ClassVar[str] = "Add"

    of: Shapes
    """The shapes."""

    @override
    def parts(self) -> tuple[Shape, ...]:
        return self.of

    @override
    def inside(self, points: Points) -> NDArray[np.bool_]:
        return in_any(self.of, points)

    @override
    def snapped(self, grid: Grid) -> tuple[Self, list[str]]:
        of, said = _all_snapped(self.of, grid)
        return self.model_copy(update={"of": of}), said


class Intersection(Combined, name="intersection"):
    """What some shapes have in common."""

    operation: ClassVar[str] = "Intersect"

    of: Shapes
    """The shapes."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if len(self.facets().simplices) == 0:
            raise ValueError("the shapes have nothing in common")
        return self

    @override
    def parts(self) -> tuple[Shape, ...]:
        return self.of

    @override
    def inside(self, points: Points) -> NDArray[np.bool_]:
        return np.all([part.inside(points) for part in self.of], axis=0)

    @override
    def snapped(self, grid: Grid) -> tuple[Self, list[str]]:
        of, said = _all_snapped(self.of, grid)
        return self.model_copy(update={"of": of}), said


class Difference(Combined, name="difference"):
    """A shape without what lies in one or several others."""

    operation: ClassVar[str] = "Subtract"

    of: Shape
    """The shape from which others are taken away."""
    without: Shapes
    """The shapes that are taken away."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if len(self.facets().simplices) == 0:
            raise ValueError("nothing is left of the shape")
        return self

    @override
    def parts(self) -> tuple[Shape, ...]:
        return (self.of, *self.without)

    @override
    def inside(self, points: Points) -> NDArray[np.bool_]:
        return self.of.inside(points) & ~in_any(self.without, points)

    @override
    def snapped(self, grid: Grid) -> tuple[Self, list[str]]:
        of, said = self.of.snapped(grid)
        without, more = _all_snapped(self.without, grid)
        return self.model_copy(update={"of": of, "without": without}), said + more


def in_any(parts: Sequence[Shape], points: Points) -> NDArray[np.bool_]:
    """Return which points lie in at least one shape, or on a face between two of them."""
    found = np.any([part.inside(points) for part in parts], axis=0)
    if len(parts) > 1 and not found.all():
        # A face between two shapes is a part of neither: look to both sides of what is left.
        left = np.flatnonzero(~found)
        corners = np.array([part.bounds() for part in parts])
        step = 1e-9 * float((corners[:, 1] - corners[:, 0]).max()) * np.array(_ASIDE[: points.shape[1]])
        one, other = ([part.inside(points[left] + s * step) for part in parts] for s in (1.0, -1.0))
        found[left] = np.any(one, axis=0) & np.any(other, axis=0)
    return np.asarray(found)


def _all_snapped(parts: Sequence[Shape], grid: Grid) -> tuple[tuple[Shape, ...], list[str]]:
    said: list[str] = []
    result = []
    for part in parts:
        moved, sentences = part.snapped(grid)
        result.append(moved)
        said += sentences
    return tuple(result), said


@lru_cache(maxsize=64)
def _facets(shape: Combined) -> Facets:
    parts = [part.facets() for part in shape.parts()]
    return _flat(parts, shape) if parts[0].vertices.shape[1] == 2 else _solid(parts, shape)


def _chain(parts: list[Any], shape: Combined) -> Any:
    """Return the first part combined with all others."""
    result = parts[0]
    for part in parts[1:]:
        result = {"Add": result.__add__, "Subtract": result.__sub__, "Intersect": result.__xor__}[shape.operation](part)
    return result


def _solid(parts: list[Facets], shape: Combined) -> Facets:
    from manifold3d import Error, Manifold, Mesh64

    solids = []
    for part in parts:
        solid = Manifold(Mesh64(part.vertices, part.simplices.astype(np.uint64)))
        if solid.status() != Error.NoError:
            raise ValueError(f"the surface of one of its shapes is no closed solid ({solid.status().name})")
        solids.append(solid)
    mesh = _chain(solids, shape).to_mesh64()
    vertices = np.asarray(mesh.vert_properties, dtype=float).reshape(-1, 3)[:, :3]
    return Facets(vertices, np.asarray(mesh.tri_verts, dtype=np.int64).reshape(-1, 3))


def _flat(parts: list[Facets], shape: Combined) -> Facets:
    from manifold3d import CrossSection, FillRule

    # Plane sections are computed on whole numbers of 1e-8: make the shape of the size one, and undo the rounding.
    corners = np.concatenate([part.vertices for part in parts])
    middle, size = corners.mean(axis=0), float(np.ptp(corners, axis=0).max())
    sections = []
    for part in parts:
        loops = _loops(part)
        sections.append(CrossSection([(loop - middle) / size for loop in loops], FillRule.NonZero))
    vertices, simplices, start = [np.empty((0, 2))], [np.empty((0, 2), dtype=np.int64)], 0
    for loop in _chain(sections, shape).to_polygons():
        vertices.append(_as_written(np.asarray(loop, dtype=float) * size + middle, corners, 1e-7 * size))
        number = start + np.arange(len(loop))
        simplices.append(np.column_stack([number, np.roll(number, -1)]))
        start += len(loop)
    return Facets(np.concatenate(vertices), np.concatenate(simplices))


def _as_written(vertices: Points, corners: Points, tolerance: float) -> Points:
    """Return vertices whose coordinates are those of the parts' corners where they nearly are."""
    result = vertices.copy()
    for k in range(vertices.shape[1]):
        known = np.unique(corners[:, k])
        at = np.clip(np.searchsorted(known, vertices[:, k]), 1, len(known) - 1)
        left, right = known[at - 1], known[at]
        near = np.where(np.abs(left - vertices[:, k]) < np.abs(right - vertices[:, k]), left, right)
        result[:, k] = np.where(np.abs(near - vertices[:, k]) < tolerance, near, vertices[:, k])
    return result


def _loops(part: Facets) -> list[NDArray[np.float64]]:
    """Return the closed lines of a plane surface, whose segments follow each other."""
    ends = np.flatnonzero(part.simplices[:, 1] != np.roll(part.simplices[:, 0], -1))
    pieces = np.split(part.simplices[:, 0], [e + 1 for e in ends if e + 1 < len(part.simplices)])
    return [part.vertices[piece] for piece in pieces]
