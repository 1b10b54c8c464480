"""Shapes of fluids and walls: bounds, signed distance and nearest point of the surface."""

from __future__ import annotations

import math
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from typing_extensions import override

from spume.geometry.facets import Facets, ball, circle, outline, prism
from spume.geometry.grid import Grid
from spume.named import Scheme

Points = NDArray[np.float64]
Vector = tuple[float, ...]
Face = Literal["left", "right", "front", "back", "bottom", "top"]


class Shape(Scheme, family="shape", selector="kind"):
    """A region of space, given by its signed distance.

    Keys are lengths in metres. A shape is two- or three-dimensional as the case is; `dimensions`
    says where it can be used. Points are arrays of shape (n, d).
    """

    dimensions: ClassVar[tuple[int, ...]] = (2, 3)
    """Dimensions in which the shape exists."""

    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the lower and upper corner [m] of the smallest axis-aligned box around the shape."""
        raise NotImplementedError

    def nearest(self, points: Points) -> Points:
        """Return the point of the surface [m] nearest to each point, shape (n, d)."""
        raise NotImplementedError

    def inside(self, points: Points) -> NDArray[np.bool_]:
        """Return which points lie inside, shape (n,)."""
        raise NotImplementedError

    def distance(self, points: Points) -> NDArray[np.float64]:
        """Return the signed distance [m] of each point from the surface, negative inside."""
        gap = np.linalg.norm(self.nearest(points) - points, axis=1)
        return np.where(self.inside(points), -gap, gap)

    def distance_within(self, points: Points, reach: float) -> NDArray[np.float64]:
        """Return `distance` where it is less than `reach` [m], elsewhere that or an infinite one; shape (n,)."""
        return self.distance(points)

    def gap(self, points: Points) -> NDArray[np.float64]:
        """Return the distance [m] of each point, shape (n,), from the surface, open faces excluded."""
        return np.abs(self.distance(points))

    def facets(self) -> Facets:
        """Return the surface as segments or triangles; curved ones to 2e-4 of their radius."""
        raise NotImplementedError

    def measure(self) -> float:
        """Return the area [m^2] in 2D or the volume [m^3] in 3D."""
        raise NotImplementedError

    def surface(self) -> float:
        """Return the length [m] in 2D or the area [m^2] in 3D of the surface, without open faces."""
        raise NotImplementedError

    def snapped(self, grid: Grid) -> tuple[Self, list[str]]:
        """Return the shape with its plane faces moved to the nearest cell faces of `grid`.

        Also returns one sentence for each face that had to move by more than 1 % of the spacing.
        Curved and sloping surfaces stay: a cell belongs to them if its centre does.

        Raises:
            ValueError: the shape is thinner than half a spacing.
        """
        return self, []

    def solid_side(self, points: Points) -> NDArray[np.bool_]:
        """Return where rows of a wall that contains fluid may stand (not beyond an open face), shape (n,)."""
        return np.ones(len(points), dtype=bool)

    def below_rim(self, points: Points) -> NDArray[np.float64]:
        """Return how far below the plane of an open upper face points [m], shape (n, d), are [m]; inf without one."""
        return np.full(len(points), np.inf)


class _Corners(Shape):
    """What an axis-aligned box and a tank share."""

    lower: Vector
    """Lower corner [m]."""
    upper: Vector
    """Upper corner [m]."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if len(self.lower) != len(self.upper):
            raise ValueError(f"lower {self.lower} and upper {self.upper} must have as many numbers")
        if any(a >= b for a, b in zip(self.lower, self.upper, strict=True)):
            raise ValueError(f"lower {self.lower} must be less than upper {self.upper} along every axis")
        return self

    @override
    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return np.array(self.lower, dtype=float), np.array(self.upper, dtype=float)

    @override
    def inside(self, points: Points) -> NDArray[np.bool_]:
        lower, upper = self.bounds()
        return np.asarray(np.all((points > lower) & (points < upper), axis=1))

    @override
    def nearest(self, points: Points) -> Points:
        return _nearest_on_box(points, *self.bounds(), self.open_faces())

    @override
    def distance(self, points: Points) -> NDArray[np.float64]:
        lower, upper = self.bounds()
        q = np.maximum(lower - points, points - upper)
        outside = np.linalg.norm(np.maximum(q, 0.0), axis=1)
        return np.asarray(outside + np.minimum(q.max(axis=1), 0.0))

    @override
    def measure(self) -> float:
        lower, upper = self.bounds()
        return float(np.prod(upper - lower))

    @override
    def surface(self) -> float:
        lower, upper = self.bounds()
        faces = np.prod(upper - lower) / (upper - lower)
        return float(np.sum(~self.open_faces() * faces))

    @override
    def facets(self) -> Facets:
        lower, upper = self.bounds()
        (x0, y0), (x1, y1) = lower[:2], upper[:2]
        loop = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
        if len(lower) == 2:
            return outline(loop)
        return prism(loop, np.array([0.0, 0.0, lower[2]]), np.diag([1.0, 1.0, upper[2] - lower[2]]))

    def open_faces(self) -> NDArray[np.bool_]:
        """Return which faces are open, shape (2, d): lower and upper face of each axis.

        Raises:
            ValueError: an open face that does not exist in the shape's dimension.
        """
        return np.zeros((2, len(self.lower)), dtype=bool)

    @override
    def snapped(self, grid: Grid) -> tuple[Self, list[str]]:
        said: list[str] = []
        lower = tuple(grid.snap(x, k, f"lower {'xyz'[k]}", said) for k, x in enumerate(self.lower))
        upper = tuple(grid.snap(x, k, f"upper {'xyz'[k]}", said) for k, x in enumerate(self.upper))
        for k, (a, b) in enumerate(zip(lower, upper, strict=True)):
            if a >= b:
                raise ValueError(f"its {'xyz'[k]} extent is less than half a spacing of {grid.spacing:g} m")
        return self.model_copy(update={"lower": lower, "upper": upper}), said


class Box(_Corners, name="box"):
    """An axis-aligned rectangle (2D) or block (3D) between two corners."""


class Tank(_Corners, name="tank"):
    """A rectangular tank: fluid inside, walls around it, some faces open.

    Its walls end at the rim: at an open face nothing stands beyond the face's plane.
    """

    open: tuple[Face, ...] = ()
    """Open faces: left, right (x), bottom, top (the last axis), in 3D also front, back (y)."""

    @override
    def open_faces(self) -> NDArray[np.bool_]:
        d = len(self.lower)
        faces = np.zeros((2, d), dtype=bool)
        axis = {"left": (0, 0), "right": (1, 0), "bottom": (0, d - 1), "top": (1, d - 1)}
        axis |= {"front": (0, 1), "back": (1, 1)} if d == 3 else {}
        for face in self.open:
            if face not in axis:
                raise ValueError(f"open: {face!r} exists in 3D only")
            faces[axis[face]] = True
        return faces

    @model_validator(mode="after")
    def _check_open(self) -> Self:
        if self.open_faces().all():
            raise ValueError("a tank with every face open has no walls")
        return self

    @override
    def below_rim(self, points: Points) -> NDArray[np.float64]:
        if not self.open_faces()[1, -1]:
            return super().below_rim(points)
        return np.asarray(self.upper[-1] - points[:, -1])

    @override
    def gap(self, points: Points) -> NDArray[np.float64]:
        nearest = np.full(len(points), np.inf)
        for side, axis in np.argwhere(~self.open_faces()):
            lower, upper = self.bounds()
            lower[axis] = upper[axis] = (lower, upper)[side][axis]
            on_face = np.clip(points, lower, upper)
            np.minimum(nearest, np.linalg.norm(points - on_face, axis=1), out=nearest)
        return nearest

    @override
    def solid_side(self, points: Points) -> NDArray[np.bool_]:
        lower, upper = self.bounds()
        below, above = self.open_faces()
        beyond = (below & (points < lower)) | (above & (points > upper))
        return np.asarray(~beyond.any(axis=1))


def _nearest_on_box(
    points: Points, lower: NDArray[np.float64], upper: NDArray[np.float64], absent: NDArray[np.bool_]
) -> Points:
    """Return the nearest point on those faces of a box that are not absent; ties go to the first axis."""
    result = np.clip(points, lower, upper)
    within = np.all(result == points, axis=1)
    inner = points[within]
    if len(inner):
        gaps = np.stack([inner - lower, upper - inner], axis=1)  # (n, 2, d)
        gaps[:, absent] = np.inf
        scale = float((upper - lower).max())
        gaps = np.round(gaps / scale, 12)  # so that equal distances are equal and the tie is decided
        flat = gaps.transpose(0, 2, 1).reshape(len(inner), -1)
        choice = flat.argmin(axis=1)
        axis, side = choice // 2, choice % 2
        rows = np.arange(len(inner))
        moved = inner.copy()
        moved[rows, axis] = np.where(side == 0, lower[axis], upper[axis])
        result[within] = moved
    return result


class Sphere(Shape, name="sphere"):
    """A sphere; in 2D a disk."""

    centre: Vector
    """Centre [m]."""
    radius: Annotated[float, Field(gt=0)]
    """Radius [m]."""

    @override
    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        centre = np.array(self.centre, dtype=float)
        return centre - self.radius, centre + self.radius

    @override
    def nearest(self, points: Points) -> Points:
        centre = np.array(self.centre, dtype=float)
        r = points - centre
        length = np.linalg.norm(r, axis=1, keepdims=True)
        at_centre = length[:, 0] == 0.0
        r[at_centre, 0], length[at_centre] = 1.0, 1.0
        return np.asarray(centre + self.radius * r / length)

    @override
    def inside(self, points: Points) -> NDArray[np.bool_]:
        return np.asarray(np.linalg.norm(points - np.array(self.centre), axis=1) < self.radius)

    @override
    def facets(self) -> Facets:
        centre = np.array(self.centre, dtype=float)
        return outline(centre + circle(self.radius)) if len(centre) == 2 else ball(centre, self.radius)

    @override
    def measure(self) -> float:
        return math.pi * self.radius**2 if len(self.centre) == 2 else 4.0 / 3.0 * math.pi * self.radius**3

    @override
    def surface(self) -> float:
        return 2.0 * math.pi * self.radius if len(self.centre) == 2 else 4.0 * math.pi * self.radius**2


class Cylinder(Shape, name="cylinder"):
    """A circular cylinder with plane ends (3D)."""

    dimensions: ClassVar[tuple[int, ...]] = (3,)

    start: Vector
    """Centre of one end [m]."""
    end: Vector
    """Centre of the other end [m]."""
    radius: Annotated[float, Field(gt=0)]
    """Radius [m]."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if len(self.start) != 3 or len(self.end) != 3:
            raise ValueError("start and end must each have three numbers")
        if self.start == self.end:
            raise ValueError("start and end must differ")
        return self

    def _axis(self) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
        start = np.array(self.start, dtype=float)
        axis = np.array(self.end, dtype=float) - start
        length = float(np.linalg.norm(axis))
        return start, axis / length, length

    @override
    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        _, axis, _ = self._axis()
        reach = self.radius * np.sqrt(np.maximum(0.0, 1.0 - axis**2))
        ends = np.array([self.start, self.end], dtype=float)
        return ends.min(axis=0) - reach, ends.max(axis=0) + reach

    def _coordinates(self, points: Points) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return distance along the axis, distance from it, and the unit vector away from it."""
        start, axis, _ = self._axis()
        along = (points - start) @ axis
        away = points - start - along[:, None] * axis
        radial = np.linalg.norm(away, axis=1)
        on_axis = radial < 1e-14 * self.radius
        normal = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        away = np.where(on_axis[:, None], normal / np.linalg.norm(normal), away)
        return along, radial, away / np.linalg.norm(away, axis=1, keepdims=True)

    @override
    def nearest(self, points: Points) -> Points:
        start, axis, length = self._axis()
        along, radial, away = self._coordinates(points)
        inside = (along > 0) & (along < length) & (radial < self.radius)
        a, r = np.clip(along, 0.0, length), np.minimum(radial, self.radius)
        gaps = np.stack([self.radius - radial, along, length - along], axis=1)
        choice = np.round(gaps / max(length, self.radius), 12).argmin(axis=1)
        r = np.where(inside & (choice == 0), self.radius, r)
        a = np.where(inside & (choice == 1), 0.0, np.where(inside & (choice == 2), length, a))
        return np.asarray(start + a[:, None] * axis + r[:, None] * away)

    @override
    def inside(self, points: Points) -> NDArray[np.bool_]:
        _, _, length = self._axis()
        along, radial, _ = self._coordinates(points)
        return np.asarray((along > 0) & (along < length) & (radial < self.radius))

    @override
    def facets(self) -> Facets:
        start, axis, length = self._axis()
        across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        across /= np.linalg.norm(across)
        return prism(circle(self.radius), start, np.array([across, np.cross(axis, across), length * axis]))

    @override
    def measure(self) -> float:
        return math.pi * self.radius**2 * self._axis()[2]

    @override
    def surface(self) -> float:
        return 2.0 * math.pi * self.radius * (self.radius + self._axis()[2])

    @override
    def snapped(self, grid: Grid) -> tuple[Self, list[str]]:
        _, axis, _ = self._axis()
        k = int(np.abs(axis).argmax())
        if abs(axis[k]) < 1.0 - 1e-12:
            return self, []
        said: list[str] = []
        start, end = list(self.start), list(self.end)
        start[k] = grid.snap(start[k], k, f"start {'xyz'[k]}", said)
        end[k] = grid.snap(end[k], k, f"end {'xyz'[k]}", said)
        if start[k] == end[k]:
            raise ValueError(f"its length is less than half a spacing of {grid.spacing:g} m")
        return self.model_copy(update={"start": tuple(start), "end": tuple(end)}), said


class Polygon(Shape, name="polygon"):
    """A polygon without holes and without crossing edges (2D)."""

    dimensions: ClassVar[tuple[int, ...]] = (2,)

    vertices: Annotated[tuple[Vector, ...], Field(min_length=3)]
    """Vertices [m] in order, either way round; the last joins the first."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if any(len(vertex) != 2 for vertex in self.vertices):
            raise ValueError("every vertex must have two numbers")
        v = self._vertices()
        a, b = v, np.roll(v, -1, axis=0)
        if np.any(np.all(a == b, axis=1)):
            raise ValueError("two neighbouring vertices are the same (the last joins the first by itself)")
        n = len(v)
        for i in range(n):
            for j in range(i + 2, n if i > 0 else n - 1):
                if _cross(a[i], b[i], a[j], b[j]):
                    raise ValueError(f"the edges that start at vertices {i + 1} and {j + 1} meet")
        if self.measure() == 0.0:
            raise ValueError("the vertices enclose no area")
        return self

    def _vertices(self) -> NDArray[np.float64]:
        return np.array(self.vertices, dtype=float)

    @override
    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        v = self._vertices()
        return v.min(axis=0), v.max(axis=0)

    @override
    def nearest(self, points: Points) -> Points:
        v = self._vertices()
        best = np.full(len(points), np.inf)
        result = np.empty_like(points)
        for a, b in zip(v, np.roll(v, -1, axis=0), strict=True):
            edge = b - a
            t = np.clip((points - a) @ edge / (edge @ edge), 0.0, 1.0)
            foot = a + t[:, None] * edge
            gap = np.linalg.norm(foot - points, axis=1)
            nearer = gap < best * (1.0 - 1e-12)
            best[nearer], result[nearer] = gap[nearer], foot[nearer]
        return result

    @override
    def inside(self, points: Points) -> NDArray[np.bool_]:
        v = self._vertices()
        odd = np.zeros(len(points), dtype=bool)
        x, y = points[:, 0], points[:, 1]
        for (xa, ya), (xb, yb) in zip(v, np.roll(v, -1, axis=0), strict=True):
            if ya == yb:
                continue
            crosses = (y >= min(ya, yb)) & (y < max(ya, yb))
            odd ^= crosses & (x < xa + (y - ya) * (xb - xa) / (yb - ya))
        return odd

    @override
    def facets(self) -> Facets:
        return outline(self._vertices())

    @override
    def measure(self) -> float:
        x, y = self._vertices().T
        return float(abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2.0)

    @override
    def surface(self) -> float:
        v = self._vertices()
        return float(np.linalg.norm(np.roll(v, -1, axis=0) - v, axis=1).sum())

    @override
    def snapped(self, grid: Grid) -> tuple[Self, list[str]]:
        v, before = self._vertices(), self._vertices()
        level = (v == np.roll(v, -1, axis=0)) | (v == np.roll(v, 1, axis=0))  # on an edge along an axis
        said: list[str] = []
        for k, x in dict.fromkeys((int(k), float(before[i, k])) for i, k in np.argwhere(level)):
            mine = np.flatnonzero(level[:, k] & (before[:, k] == x))
            which = f"{'vertices' if len(mine) > 1 else 'vertex'} {', '.join(str(i + 1) for i in mine)}"
            v[mine, k] = grid.snap(x, k, f"{'xy'[k]} of {which}", said)
        try:
            return type(self)(vertices=tuple(map(tuple, v.tolist()))), said
        except ValueError:
            raise ValueError(f"its edges collapse on a spacing of {grid.spacing:g} m") from None


def _cross(a: Any, b: Any, c: Any, d: Any) -> bool:
    """Whether the segments ab and cd have a point in common."""

    def side(p: Any, q: Any, r: Any) -> float:
        return float(np.sign((q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])))

    def on(p: Any, q: Any, r: Any) -> bool:
        return bool(np.all(r >= np.minimum(p, q)) and np.all(r <= np.maximum(p, q)))

    s1, s2, s3, s4 = side(a, b, c), side(a, b, d), side(c, d, a), side(c, d, b)
    if s1 != s2 and s3 != s4:
        return True
    touching = ((s1, (a, b, c)), (s2, (a, b, d)), (s3, (c, d, a)), (s4, (c, d, b)))
    return any(s == 0 and on(*ends) for s, ends in touching)
