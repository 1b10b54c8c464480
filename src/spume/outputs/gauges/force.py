"""Gauge of the pressure force and moment on a body."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from spume.outputs.gauge import Gauge
from spume.outputs.near import nearest
from spume.outputs.snapshot import DUMMY, FLUID, WALL, Snapshot


class Force(Gauge, name="force"):
    """Force and moment that the water's pressure exerts on a body.

    F = −Σ p_f A e_f,   M = Σ (x_f − c) × (−p_f A e_f),   f: wet faces of the cells of the wall rows, A = l0^(d−1).

    The faces of the body's cells are a closed surface, so a constant pressure has no force, and water at rest that of
    the cells' volume; those that look one way are the body's shadow on the plane across it, whatever its slopes.
    A row at an outer edge has two or three faces, one behind an inner corner none. A face is wet if fluid is within
    0.95 l0 of the middle of the cell beyond it and no row of another body fills that cell. x_f is where the face's
    direction e_f meets the surface, and p_f = p_i + ρ (g − a_wall)·(x_f − x_i) takes the row's pressure there with the
    inhomogeneous wall condition, ρ of the nearest fluid row. A dry face beside enclosed air has that air's pressure.
    Friction is not included.
    """

    reads: ClassVar[tuple[str, ...]] = (
        "position", "pressure", "density", "kind", "body", "to_surface", "exposed", "wall_acceleration",
    )  # fmt: skip
    reads_if_there: ClassVar[tuple[str, ...]] = ("air_pressure",)

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
        exposed = np.asarray(snapshot["exposed"])[rows]
        pose = snapshot.poses.get(self.body)
        axes = np.eye(d) if pose is None else pose.unturned(np.eye(d)).T
        area = snapshot.spacing ** (d - 1)
        centre = np.zeros(d) if self.origin is None else np.asarray(self.origin, dtype=float)
        total, moments = np.zeros(d), np.zeros(3)
        for axis in range(d):
            for upper in range(2):
                e = (2 * upper - 1) * axes[axis]
                faced = rows[exposed & (4**axis << upper) > 0]
                p, arm = _on_faces(snapshot, faced, e)
                total -= area * p.sum() * e
                moments -= area * np.cross(_in_space((p[:, None] * (arm - centre)).sum(axis=0)), _in_space(e))
        if d == 2:
            return {"force_x": float(total[0]), "force_y": float(total[1]), "moment_z": float(moments[2])}
        return {f"force_{a}": float(f) for a, f in zip("xyz", total, strict=True)} | {
            f"moment_{a}": float(m) for a, m in zip("xyz", moments, strict=True)
        }


def _on_faces(
    snapshot: Snapshot, rows: NDArray[np.intp], e: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return pressure [Pa], (m,), and place [m], (m, d), of those faces in a direction that are wet or feel air."""
    position = np.asarray(snapshot["position"], dtype=float)
    beyond = position[rows] + snapshot.spacing * e
    fluid = nearest(snapshot, beyond, FLUID, _WET)
    if "air_pressure" in snapshot.fields:
        air = np.asarray(snapshot["air_pressure"], dtype=float)[rows]
    else:
        air = np.zeros(len(rows))
    felt = ((fluid >= 0) | (air != 0.0)) & (nearest(snapshot, beyond, WALL | DUMMY, _FILLED) < 0)
    rows, fluid, air = rows[felt], fluid[felt], air[felt]
    to_surface = np.asarray(snapshot["to_surface"], dtype=float)[rows]
    along = to_surface @ e
    square = np.einsum("ij,ij->i", to_surface, to_surface)
    # Of a row at an outer edge the face that it does not look at lies half a spacing away.
    looks = along > 0.1 * np.sqrt(square)
    way = np.where(looks, np.minimum(square / np.where(looks, along, 1.0), snapshot.spacing), 0.5 * snapshot.spacing)
    acceleration = np.asarray(snapshot["wall_acceleration"], dtype=float)[rows] @ e
    p = np.asarray(snapshot["pressure"], dtype=float)[rows]
    density = np.asarray(snapshot["density"], dtype=float)[fluid]
    return np.where(fluid >= 0, p + density * acceleration * way, air), position[rows] + way[:, None] * e


def _in_space(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.pad(vector, (0, 3 - len(vector)))


_WET = 0.95
"""Fluid nearer than this to the middle of the cell beyond a face wets it [l0]: one that lies a row higher does not."""
_FILLED = 0.6
"""A row of another body nearer than this fills the cell [l0]."""
