"""Gauge of the pressure force and moment on a body."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from spume.outputs.gauge import Gauge
from spume.outputs.gauges.pressure import nearest_fluid
from spume.outputs.snapshot import WALL, Snapshot


class Force(Gauge, name="force"):
    """Force and moment that the water's pressure exerts on a body.

    F = −Σ p_s,i n_i A_i,   M = Σ (x_s,i − c) × (−p_s,i n_i A_i),   i: wet wall rows,

    n_i = to_surface / |to_surface| looks into the water, x_s,i = x_i + to_surface lies on the wall's
    surface, and p_s,i = p_i + ρ (g − a_wall)·to_surface takes the row's pressure there with the inhomogeneous
    wall condition, ρ of the nearest fluid row. A wall row is wet if fluid is within 1.5 l0. A_i is the row's
    ``face_area``, l0^(d−1) on a flat wall along the lattice; rows behind an inner corner have none. Where one row
    stands behind both faces of an outer corner it counts for the face to which it points, so such a body lacks up to
    l0 of the other face. Friction is not included.
    """

    reads: ClassVar[tuple[str, ...]] = (
        "position", "pressure", "density", "kind", "body", "to_surface", "face_area", "wall_acceleration",
    )  # fmt: skip

    body: str
    """Name of the body."""
    origin: tuple[float, ...] | None = None
    """Point c about which the moment is taken [m]; default: the origin of coordinates."""

    def columns(self, dimension: int) -> dict[str, str]:
        if dimension == 2:
            return {"force_x": "N/m", "force_y": "N/m", "moment_z": "N m/m"}
        return {f"force_{a}": "N" for a in "xyz"} | {f"moment_{a}": "N m" for a in "xyz"}

    def check(self, snapshot: Snapshot) -> None:
        if self.body not in snapshot.bodies:
            known = ", ".join(repr(b) for b in snapshot.bodies) or "(the case has none)"
            raise ValueError(f"gauge {self.name!r}: body = {self.body!r}: one of {known}")
        if self.origin is not None:
            self.vector("origin", self.origin, snapshot.dimension)

    def measure(self, snapshot: Snapshot) -> dict[str, float]:
        d = snapshot.dimension
        index = snapshot.bodies.index(self.body)
        rows = np.flatnonzero((np.asarray(snapshot["kind"]) == WALL) & (np.asarray(snapshot["body"]) == index))
        to_surface = np.asarray(snapshot["to_surface"], dtype=float)[rows]
        area = np.asarray(snapshot["face_area"], dtype=float)[rows]
        faced = area > 0.0
        rows, to_surface, area = rows[faced], to_surface[faced], area[faced]
        near = nearest_fluid(snapshot, rows)
        wet = near >= 0
        rows, near, to_surface, area = rows[wet], near[wet], to_surface[wet], area[wet]
        distance = np.linalg.norm(to_surface, axis=1)
        p = np.asarray(snapshot["pressure"], dtype=float)[rows]
        acceleration = np.asarray(snapshot["wall_acceleration"], dtype=float)[rows]
        p = p + np.asarray(snapshot["density"], dtype=float)[near] * np.einsum("ij,ij->i", to_surface, acceleration)
        force: NDArray[np.float64] = -(p * area / distance)[:, None] * to_surface
        centre = np.zeros(d) if self.origin is None else np.asarray(self.origin, dtype=float)
        arm = np.asarray(snapshot["position"], dtype=float)[rows] + to_surface - centre
        total = force.sum(axis=0)
        if d == 2:
            moment = float(np.sum(arm[:, 0] * force[:, 1] - arm[:, 1] * force[:, 0]))
            return {"force_x": float(total[0]), "force_y": float(total[1]), "moment_z": moment}
        moments = np.cross(arm, force).sum(axis=0)
        return {f"force_{a}": float(f) for a, f in zip("xyz", total, strict=True)} | {
            f"moment_{a}": float(m) for a, m in zip("xyz", moments, strict=True)
        }
