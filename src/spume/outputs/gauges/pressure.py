"""Gauge of the pressure at a point or averaged over a sensor's face."""

from __future__ import annotations

from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spume.outputs.gauge import Riding
from spume.outputs.snapshot import FLUID, WALL, Snapshot

_RADIUS = 2.0  # of the average [l0]
_REACH = 1.5  # a wall row is wet, and a point is reached, if fluid is within this distance [l0]
_LARGEST_CONDITION = 1e4  # of the moments; beyond it the average is of order zero


class Pressure(Riding, name="pressure"):
    """Pressure at a point, or averaged over the face of a sensor.

    At a point x the pressure is the value a of the plane fitted to the rows within R = 2 l0,

        minimise Σ_j w_j (p_j − a − b·(x_j − x))²,   w_j = (1 − (r_j/R)²)²,

    over fluid rows and wet wall rows (the first solid layer, which carries pressure; wet: fluid within
    1.5 l0). It is exact for a linear pressure. Fluid lies l0/2 on one side of a wall, wall rows l0/2 on
    the other, so a point on the wall is inside the data; a result outside their range is cut to it, and
    where the rows do not span a plane (a jet's tip) the weighted mean Σ w p / Σ w takes its place. No
    fluid row within 1.5 l0: that of the air at the nearest row within 2 l0, zero where none is enclosed.

    With ``face`` the value is the mean over the sensor's face, or over l0 if that is larger (the
    discretisation knows no smaller face): in 2D a line along the wall, in 3D a disc, by 5 and 13 points.
    The part of a face beyond a corner, inside a wall, is left out.
    """

    reads: ClassVar[tuple[str, ...]] = ("position", "pressure", "kind", "to_surface")
    reads_if_there: ClassVar[tuple[str, ...]] = ("air_pressure",)

    at: tuple[float, ...]
    """Position of the sensor's centre [m], on the plane of the wall or in the fluid."""
    face: Annotated[float, Field(gt=0.0)] | None = None
    """Diameter (2D: length) of the sensor's face [m]; default: a point."""
    normal: tuple[float, ...] | None = None
    """Normal of the face, of any length [1]; default: that of the nearest wall."""

    def columns(self, dimension: int) -> dict[str, str]:
        return {"pressure": "Pa"}

    def check(self, snapshot: Snapshot) -> None:
        super().check(snapshot)
        self.vector("at", self.at, snapshot.dimension)
        if self.normal is not None:
            n = self.vector("normal", self.normal, snapshot.dimension)
            if not np.any(n):
                raise ValueError(f"gauge {self.name!r}: normal = {list(n)}: not the zero vector")
        elif self.face is not None and self._wall_normal(snapshot.around(self.at)) is None:
            raise ValueError(
                f"gauge {self.name!r}: no wall within {_RADIUS:g} spacings of at = {list(self.at)} gives the "
                "face its normal; give normal = [...]"
            )

    def blind(self, snapshot: Snapshot) -> str:
        """Fluid stays half a spacing off a surface: what is more than l0 behind one is reached by none."""
        point = np.asarray(self.at, dtype=float)
        depth = depth_in_wall(snapshot.around(self.at), point)
        if depth <= (_REACH - 0.5) * snapshot.spacing:
            return ""
        return f"lies {depth / snapshot.spacing:.2g} spacings inside a wall"

    def measure(self, snapshot: Snapshot) -> dict[str, float]:
        snapshot = snapshot.seen_from(self.body).around(self.at)
        l0 = snapshot.spacing
        position = np.asarray(snapshot["position"], dtype=float)
        centre = np.asarray(self.at, dtype=float)
        far = (_RADIUS + _REACH) * l0 + (0.0 if self.face is None else max(self.face, l0))
        near = np.flatnonzero(np.all(np.abs(position - centre) < far, axis=1))
        kind = np.asarray(snapshot["kind"])[near]
        fluid = near[kind == FLUID]
        points = self._points(snapshot) if len(fluid) else centre[None, :]
        air = _air(snapshot, points, near)
        if len(fluid) == 0:
            return {"pressure": float(air[0])}
        wall = near[kind == WALL]
        wall = wall[wet_rows(snapshot, wall, fluid)]
        rows = np.concatenate([fluid, wall])
        p = np.asarray(snapshot["pressure"], dtype=float)[rows]
        values = [point_value(x, position[rows], p, len(fluid), l0, a) for x, a in zip(points, air, strict=True)]
        return {"pressure": float(np.mean(values))}

    def _wall_normal(self, snapshot: Snapshot) -> NDArray[np.float64] | None:
        """Return the normal of the wall at the sensor, from the row whose face is nearest to it."""
        l0 = snapshot.spacing
        position = np.asarray(snapshot["position"], dtype=float)
        to_surface = np.asarray(snapshot["to_surface"], dtype=float)
        near = np.all(np.abs(position - np.asarray(self.at)) < _RADIUS * l0, axis=1)
        rows = np.flatnonzero(near & (np.asarray(snapshot["kind"]) == WALL))
        distance = np.linalg.norm(to_surface[rows], axis=1)
        rows = rows[(distance > 0.0) & (distance < 0.6 * l0)]  # rows behind a corner have no face
        if len(rows) == 0:
            return None
        from_centre = position[rows] + to_surface[rows] - np.asarray(self.at)
        n: NDArray[np.float64] = to_surface[rows[np.argmin(np.einsum("ij,ij->i", from_centre, from_centre))]]
        return n / np.linalg.norm(n)

    def _points(self, snapshot: Snapshot) -> NDArray[np.float64]:
        """Return the points over which the pressure is averaged, shape (points, d)."""
        centre = np.asarray(self.at, dtype=float)
        if self.face is None:
            return centre[None, :]
        n = self._wall_normal(snapshot) if self.normal is None else np.asarray(self.normal, dtype=float)
        if n is None:
            return centre[None, :]
        n = n / np.linalg.norm(n)
        size = max(self.face, snapshot.spacing)
        if snapshot.dimension == 2:
            along = np.array([-n[1], n[0]])
            points = centre + np.linspace(-0.4, 0.4, 5)[:, None] * size * along
        else:
            first = np.cross(n, np.eye(3)[np.argmin(np.abs(n))])
            first /= np.linalg.norm(first)
            second = np.cross(n, first)
            points = centre + 0.5 * size * (_DISC[:, :1] * first + _DISC[:, 1:] * second)
        return points[~_behind_a_wall(snapshot, points, centre)]


def _air(snapshot: Snapshot, points: NDArray[np.float64], rows: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return the pressure of enclosed air at points [Pa]: that of the nearest of some rows within 2 l0, else 0."""
    values = np.zeros(len(points))
    if "air_pressure" not in snapshot.fields or len(rows) == 0:
        return values
    air = np.asarray(snapshot["air_pressure"], dtype=float)[rows]
    if not air.any():
        return values
    position = np.asarray(snapshot["position"], dtype=float)[rows]
    distance = np.linalg.norm(position[None, :, :] - points[:, None, :], axis=2)
    near = distance.min(axis=1) < _RADIUS * snapshot.spacing
    return np.where(near, air[distance.argmin(axis=1)], 0.0)


def wet_rows(snapshot: Snapshot, rows: NDArray[np.intp], fluid: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Return which of these rows have one of the given fluid rows within 1.5 l0, shape (len(rows),)."""
    from scipy.spatial import cKDTree

    position = np.asarray(snapshot["position"], dtype=float)
    if len(rows) == 0 or len(fluid) == 0:
        return np.zeros(len(rows), dtype=bool)
    distance, _ = cKDTree(position[fluid]).query(position[rows], distance_upper_bound=_REACH * snapshot.spacing)
    return np.isfinite(distance)


def point_value(
    point: NDArray[np.float64],
    position: NDArray[np.float64],
    values: NDArray[np.float64],
    fluid: int,
    spacing: float,
    dry: float = 0.0,
) -> float:
    """Return the value of a field at a point from the rows around it, ``dry`` without fluid near.

    See :class:`Pressure`.

    Args:
        point: x [m], shape (d,).
        position: of the rows [m], shape (rows, d).
        values: of the rows, shape (rows,).
        fluid: number of fluid rows; they are the first.
        spacing: l0 [m].
        dry: the value without fluid near.
    """
    offset = (position - point) / (_RADIUS * spacing)
    q2 = np.einsum("ij,ij->i", offset, offset)
    if fluid == 0 or q2[:fluid].min() > (_REACH / _RADIUS) ** 2:
        return dry
    inside = q2 < 1.0
    w = (1.0 - q2[inside]) ** 2
    p = values[inside]
    mean = float(w @ p / w.sum())
    basis = np.column_stack([np.ones(len(w)), offset[inside]])
    moments = basis.T @ (w[:, None] * basis)
    if len(w) <= offset.shape[1] or np.linalg.cond(moments) > _LARGEST_CONDITION:
        return mean
    value = float(np.linalg.solve(moments, basis.T @ (w * p))[0])
    return min(max(value, float(p.min())), float(p.max()))


def depth_in_wall(snapshot: Snapshot, point: NDArray[np.float64]) -> float:
    """Return how far [m] a point, shape (d,), lies behind the nearest surface of a wall's rows; 0 in front of it.

    Rows say it that are at most two spacings away: far from them it is zero.
    """
    position = np.asarray(snapshot["position"], dtype=float)
    to_surface = np.asarray(snapshot["to_surface"], dtype=float)
    near = np.all(np.abs(position - point) < 2.0 * snapshot.spacing, axis=1)
    rows = np.flatnonzero(near & (np.asarray(snapshot["kind"]) != FLUID))
    distance = np.linalg.norm(to_surface[rows], axis=1)
    rows, distance = rows[distance > 0.0], distance[distance > 0.0]
    if len(rows) == 0:
        return 0.0
    away = position[rows] + to_surface[rows] - point
    gap = np.linalg.norm(away, axis=1)
    nearest = gap < gap.min() + 0.01 * snapshot.spacing  # several rows share the point of a corner
    normal = to_surface[rows] / distance[:, None]
    behind = float(np.max(np.einsum("ij,ij->i", normal[nearest], away[nearest])))
    return float(gap.min()) if behind > 0.1 * snapshot.spacing else 0.0


def _behind_a_wall(snapshot: Snapshot, points: NDArray[np.float64], centre: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which points of a face lie inside a wall: behind the surface that is nearest to them."""
    position = np.asarray(snapshot["position"], dtype=float)
    to_surface = np.asarray(snapshot["to_surface"], dtype=float)
    l0 = snapshot.spacing
    far = float(np.abs(points - centre).max()) + 2.0 * l0
    solid = np.asarray(snapshot["kind"]) != FLUID
    rows = np.flatnonzero(solid & np.all(np.abs(position - centre) < far, axis=1))
    distance = np.linalg.norm(to_surface[rows], axis=1)
    rows, distance = rows[distance > 0.0], distance[distance > 0.0]
    behind = np.zeros(len(points), dtype=bool)
    surface = position[rows] + to_surface[rows]
    normal = to_surface[rows] / distance[:, None]
    for i, x in enumerate(points):
        away = surface - x
        r2 = np.einsum("ij,ij->i", away, away)
        if len(r2) == 0:
            continue
        # Several rows share the point of a corner; a tenth of a spacing keeps points on the face itself.
        nearest = np.sqrt(r2) < np.sqrt(r2.min()) + 0.01 * l0
        behind[i] = float(np.max(np.einsum("ij,ij->i", normal[nearest], away[nearest]))) > 0.1 * l0
    return behind if not np.all(behind) else np.zeros(len(points), dtype=bool)


def _disc() -> NDArray[np.float64]:
    """Return 13 points of equal weight on the unit disc: the centre, 4 inside, 8 outside."""
    points = [(0.0, 0.0)]
    for radius, number in ((0.47, 4), (0.82, 8)):
        angle = 2.0 * np.pi * (np.arange(number) + 0.5) / number
        points += list(zip(radius * np.cos(angle), radius * np.sin(angle), strict=True))
    return np.array(points)


_DISC = _disc()
