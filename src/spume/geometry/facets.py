"""Closed surfaces of straight pieces: segments in 2D, triangles in 3D."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

Points = NDArray[np.float64]
_PIECES = 60  # pieces along the diagonal of a surface, by which the nearest facet is searched
_MOST_PAIRS = 4_000_000  # of points and facets that are looked at together


@dataclass(frozen=True, eq=False)
class Facets:
    """A closed surface whose facets look outwards.

    Attributes:
        vertices: corners [m], shape (n, d).
        simplices: for each facet the numbers of its d corners, shape (m, d); in 3D anticlockwise as
            seen from outside, in 2D with the inside on the left.
    """

    vertices: Points
    simplices: NDArray[np.int64]

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Facets):
            return NotImplemented
        same = np.array_equal(self.vertices, other.vertices) and np.array_equal(self.simplices, other.simplices)
        return self is other or same

    def __hash__(self) -> int:
        return hash((self.vertices.shape, self.simplices.shape))

    @property
    def corners(self) -> Points:
        """Corners of each facet [m], shape (m, d, d)."""
        return self.vertices[self.simplices]

    @cached_property
    def normals(self) -> Points:
        """Outward normal of each facet times its length [m] or area [m^2], shape (m, d)."""
        corners = self.corners
        if corners.shape[1] == 2:
            edge = corners[:, 1] - corners[:, 0]
            return np.column_stack([edge[:, 1], -edge[:, 0]])
        return np.asarray(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2.0)

    def measure(self) -> float:
        """Return the area [m^2] in 2D or the volume [m^3] in 3D; negative if the facets look inwards."""
        middle = self.corners.mean(axis=1) - self.vertices.mean(axis=0)  # less cancellation far from the origin
        return float(np.einsum("ij,ij->", middle, self.normals) / self.vertices.shape[1])

    def surface(self) -> float:
        """Return the length [m] in 2D or the area [m^2] in 3D of the surface."""
        return float(np.linalg.norm(self.normals, axis=1).sum())

    def bounds(self) -> tuple[Points, Points]:
        """Return the lower and upper corner [m] of the surface."""
        used = self.vertices[np.unique(self.simplices)]
        return used.min(axis=0), used.max(axis=0)

    def samples(self, number: int, seed: int = 0) -> tuple[Points, Points]:
        """Return points spread evenly over the surface [m] and unit normals there, each (number, d)."""
        area = np.linalg.norm(self.normals, axis=1)
        random = np.random.default_rng(seed)
        # One random number in each of `number` equal parts of the surface, so that no part is left out.
        at = (np.arange(number) + random.uniform(size=number)) / number * area.sum()
        facet = np.minimum(np.searchsorted(np.cumsum(area), at), len(area) - 1)
        share = random.exponential(size=(number, self.vertices.shape[1]))
        share /= share.sum(axis=1, keepdims=True)
        points = np.einsum("ij,ijk->ik", share, self.corners[facet])
        return points, self.normals[facet] / area[facet, None]

    # ------------------------------------------------------------------------------------ nearest point

    @cached_property
    def _pieces(self) -> tuple[Any, NDArray[np.int64], float]:
        """A search tree of the middles of small pieces of the facets, their facets, and the largest piece's radius."""
        from scipy.spatial import cKDTree

        lower, upper = self.bounds()
        longest = float(np.linalg.norm(upper - lower)) / _PIECES
        pieces, facet = self.corners, np.arange(len(self.simplices))
        while True:
            edges = np.roll(pieces, -1, axis=1) - pieces
            length = np.linalg.norm(edges, axis=2)
            long = np.flatnonzero(length.max(axis=1) > longest)
            if len(long) == 0:
                break
            first = length[long].argmax(axis=1)  # halve the longest edge
            second = (first + 1) % pieces.shape[1]
            rows = np.arange(len(long))
            middle = 0.5 * (pieces[long, first] + pieces[long, second])
            other = pieces[long].copy()
            other[rows, first] = middle
            pieces = pieces.copy()
            pieces[long, second] = middle
            pieces, facet = np.concatenate([pieces, other]), np.concatenate([facet, facet[long]])
        middles = pieces.mean(axis=1)
        radius = float(np.linalg.norm(pieces - middles[:, None], axis=2).max())
        return cKDTree(middles), facet, radius

    def lower_gap(self, points: Points) -> NDArray[np.float64]:
        """Return a lower bound of the distance from the surface [m], quickly and to 1/60 of its size."""
        tree, _, radius = self._pieces
        return np.maximum(tree.query(points)[0] - radius, 0.0)

    def nearest(self, points: Points) -> Points:
        """Return the point of the surface nearest to each point [m].

        Among equally near ones that along the first axis goes first, then the lower one, as on a box.
        """
        tree, facet_of, radius = self._pieces
        result = np.empty_like(points)
        reach = tree.query(points)[0] + radius * (1.0 + 1e-9)
        count = tree.query_ball_point(points, reach, return_length=True)
        start = 0
        while start < len(points):
            total = np.cumsum(count[start:])
            stop = start + max(1, int(np.searchsorted(total, _MOST_PAIRS)))
            part = slice(start, stop)
            found = tree.query_ball_point(points[part], reach[part])
            row = np.repeat(np.arange(len(found)), [len(f) for f in found])
            facet = facet_of[np.concatenate([np.asarray(f, dtype=np.int64) for f in found])]
            pairs = np.unique(row * np.int64(len(self.simplices)) + facet)
            row, facet = pairs // len(self.simplices), pairs % len(self.simplices)
            feet = _on_simplices(self.vertices[self.simplices[facet]], points[part][row])
            lower, upper = self.bounds()
            result[part] = feet[first_of_nearest(points[part], row, feet, float((upper - lower).max()))]
            start = stop
        return result

    # ------------------------------------------------------------------------------------------ inside

    def winding(self, points: Points) -> NDArray[np.int64]:
        """Return how often the surface (3D) goes round each point: 1 inside, 0 outside.

        Counts the facets above a point, +1 where they look up and -1 where they look down. Two facets
        judge their common edge by the same number, so a point below an edge is counted once.
        """
        from scipy.spatial import cKDTree

        columns, column = np.unique(points[:, :2], axis=0, return_inverse=True)
        column = column.reshape(-1)
        corners = self.corners
        low, high = corners.min(axis=1), corners.max(axis=1)
        over = np.all((high[:, :2] >= columns.min(axis=0)) & (low[:, :2] <= columns.max(axis=0)), axis=1)
        over = np.flatnonzero(over)
        middle, half = 0.5 * (low + high)[over, :2], 0.5 * (high - low)[over, :2].max(axis=1)
        tree = cKDTree(columns)
        near = tree.query_ball_point(middle, half * (1.0 + 1e-9) + 1e-300, p=np.inf) if len(over) else []
        which, height, sense = [np.empty(0, dtype=int)], [np.empty(0)], [np.empty(0, dtype=int)]
        sizes = np.array([len(n) for n in near], dtype=int)
        for part in np.array_split(np.arange(len(over)), max(1, int(sizes.sum()) // _MOST_PAIRS + 1)):
            if len(part) == 0 or sizes[part].sum() == 0:
                continue
            facet = np.repeat(over[part], sizes[part])
            at = np.concatenate([np.asarray(near[k], dtype=int) for k in part])
            turns = self._turns(facet, columns[at])
            hit = turns != 0
            which.append(at[hit])
            sense.append(turns[hit])
            height.append(self._height(facet[hit], columns[at[hit]]))
        crossing, z, turn = np.concatenate(which), np.concatenate(height), np.concatenate(sense)
        # Sort points and crossings of all columns together from top to bottom and add up.
        order = np.lexsort((-np.concatenate([points[:, 2], z]), np.concatenate([column, crossing])))
        step = np.concatenate([np.zeros(len(points), dtype=int), turn])[order]
        total = np.empty(len(order), dtype=np.int64)
        total[order] = np.cumsum(step)
        # A whole column adds up to nothing, because the surface is closed.
        return total[: len(points)]

    def _turns(self, facet: NDArray[np.int64], xy: Points) -> NDArray[np.int64]:
        """Return how often the outline of each facet, seen from above, goes round a point of the plane."""
        numbers = self.simplices[facet]
        turns = np.zeros(len(facet), dtype=np.int64)
        for k in range(3):
            a, b = numbers[:, k], numbers[:, (k + 1) % 3]
            swapped = a > b  # the same arithmetic for both facets of an edge
            u, v = self.vertices[np.where(swapped, b, a), :2], self.vertices[np.where(swapped, a, b), :2]
            crosses = (u[:, 1] <= xy[:, 1]) != (v[:, 1] <= xy[:, 1])
            area = (v[:, 0] - u[:, 0]) * (xy[:, 1] - u[:, 1]) - (xy[:, 0] - u[:, 0]) * (v[:, 1] - u[:, 1])
            upwards = v[:, 1] > u[:, 1]
            right = crosses & ((area > 0.0) == upwards) & (area != 0.0)
            turns += np.where(right, np.where(upwards ^ swapped, 1, -1), 0)
        return turns

    def _height(self, facet: NDArray[np.int64], xy: Points) -> NDArray[np.float64]:
        """Return the height at which the vertical through a point of the plane crosses each facet [m]."""
        corners = self.corners[facet]
        a, normal = corners[:, 0], self.normals[facet]
        upright = np.abs(normal[:, 2]) < 1e-14 * np.linalg.norm(normal, axis=1)
        slope = normal[:, :2] / np.where(upright, 1.0, normal[:, 2])[:, None]
        z = a[:, 2] - np.einsum("ij,ij->i", slope, xy - a[:, :2])
        return np.clip(z, corners[:, :, 2].min(axis=1), corners[:, :, 2].max(axis=1))


def _on_simplices(corners: Points, points: Points) -> Points:
    """Return the point of each segment or triangle nearest to its point."""
    if corners.shape[1] == 2:
        a, edge = corners[:, 0], corners[:, 1] - corners[:, 0]
        t = np.einsum("ij,ij->i", points - a, edge) / np.einsum("ij,ij->i", edge, edge)
        return np.asarray(a + np.clip(t, 0.0, 1.0)[:, None] * edge)
    from trimesh.triangles import closest_point

    return np.asarray(closest_point(corners, points))


def first_of_nearest(points: Points, row: NDArray[np.int64], feet: Points, size: float) -> NDArray[np.int64]:
    """Return for each point the number of its nearest foot.

    Among feet equally near to 1e-12 of `size` the one farthest along the first axis goes first, then the
    lower one, then the next axis, so that the choice depends on no numbering of facets.

    Args:
        points: shape (n, d).
        row: point of each foot; every point has at least one, shape (m,).
        feet: shape (m, d).
        size: extent of the surface [m].
    """
    away = np.round((feet - points[row]) / size, 12) + 0.0
    gap = np.round(np.linalg.norm(feet - points[row], axis=1) / size, 12)
    keys: list[Any] = []
    for k in range(points.shape[1]):
        keys += [-np.abs(away[:, k]), away[:, k]]
    order = np.lexsort((*reversed(keys), gap, row))
    _, first = np.unique(row[order], return_index=True)
    return np.asarray(order[first])


def outline(loop: Points) -> Facets:
    """Return the closed line through the corners of a polygon [m], shape (n, 2), given either way round."""
    x, y = loop.T
    if np.dot(x, np.roll(y, -1)) < np.dot(y, np.roll(x, -1)):
        loop = loop[::-1]
    first = np.arange(len(loop))
    return Facets(np.array(loop, dtype=float), np.column_stack([first, np.roll(first, -1)]))


def prism(loop: Points, origin: Points, frame: Points) -> Facets:
    """Return the surface of a prism with plane ends.

    Args:
        loop: corners of its cross-section, shape (n, 2), either way round.
        origin: point [m] where the cross-section has its origin at the first end, shape (3,).
        frame: rows are the two directions of the cross-section and the vector [m] from end to end, (3, 3).
    """
    from manifold3d import triangulate

    loop = outline(loop).vertices
    n = len(loop)
    cap = np.asarray(triangulate([loop]), dtype=np.int64)
    base = origin + loop @ frame[:2]
    first = np.arange(n)
    second = np.roll(first, -1)
    sides = [np.column_stack([first, second, second + n]), np.column_stack([first, second + n, first + n])]
    simplices = np.concatenate([cap[:, ::-1], cap + n, *sides])
    if np.linalg.det(frame) < 0.0:
        simplices = simplices[:, ::-1]
    return Facets(np.concatenate([base, base + frame[2]]), simplices)


def circle(radius: float) -> Points:
    """Return the corners of a polygon of a circle's area [m], shape (256, 2)."""
    angle = np.linspace(0.0, 2.0 * np.pi, 256, endpoint=False)
    radius = radius * float(np.sqrt(np.pi / (128.0 * np.sin(2.0 * np.pi / 256))))
    return radius * np.column_stack([np.cos(angle), np.sin(angle)])


def ball(centre: Points, radius: float) -> Facets:
    """Return a polyhedron of a sphere's volume with 20480 triangles; its centre [m] has shape (3,)."""
    from trimesh.creation import icosphere

    mesh = icosphere(subdivisions=5)
    unit = Facets(np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.int64))
    scale = (4.0 / 3.0 * np.pi / unit.measure()) ** (1.0 / 3.0)
    return Facets(centre + radius * scale * unit.vertices, unit.simplices)
