"""Case 3: a rotating square patch, where the pressure is negative."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from spume.named import CASES
from spume.tables import read_columns
from spume.validation import Bar, Curve, Folder, Measured, Panel, Run, Study
from spume.validation.study import rms

RHO, START = 1000.0, 0.1473427
PRESSURE = "rms of the pressure at the centre / its start value, to tω = 2"
ANGULAR = "largest change of the angular momentum"
VOIDS = "voids: circles of radius 1.5 l0 without a centre"


def exact() -> dict[str, np.ndarray]:
    """Return the columns, shape (n,), of the boundary-element solution."""
    return read_columns(CASES / "rotating-square" / "centre.csv")[0]


def measure(folder: Folder) -> Measured:
    """Return the error of the pressure at the centre, the change of the angular momentum, and the voids at the end."""
    gauge, reference = folder.gauge("centre"), exact()
    after = gauge["time"] > 0.0
    t, p = gauge["time"][after], gauge["pressure"][after] / RHO
    error = p - np.interp(t, reference["t omega"], reference["p"])
    momenta, times, corners = [], [], []
    for frame in folder.frames():
        x, u = frame["position"], frame["velocity"]
        momenta.append(float(np.sum(x[:, 0] * u[:, 1] - x[:, 1] * u[:, 0])))
        times.append(frame.time)
        corners.append(float(np.linalg.norm(x, axis=1).max()) + frame.spacing / math.sqrt(2.0))
    momentum = np.array(momenta)
    reached = t[-1] >= 1.99
    return Measured(
        {
            PRESSURE: rms(error) / START if reached else math.inf,
            ANGULAR: float(np.abs(momentum / momentum[0] - 1.0).max()),
            VOIDS: float(_voids(x, frame.spacing)),
            "error of the corners' distance / L at tω = 2": corners[-1] - float(reference["corner"][-1]),
        },
        {
            "pressure at the centre": (t, p),
            "angular momentum": (np.array(times), momentum / momentum[0]),
            "distance of the corners": (np.array(times), np.array(corners)),
        },
    )


def _voids(position: np.ndarray, l0: float) -> int:
    """Return the number of lattice points inside the fluid with no centre within 1.5 l0.

    A point is inside if there are centres within 4 l0 in each of eight directions' sectors around it.
    """
    from scipy.spatial import cKDTree

    tree = cKDTree(position)
    low, high = position.min(axis=0), position.max(axis=0)
    grid = np.stack(np.meshgrid(*(np.arange(a, b, 0.5 * l0) for a, b in zip(low, high, strict=True))), -1).reshape(
        -1, 2
    )
    empty = grid[tree.query(grid)[0] > 1.5 * l0]
    inside = 0
    for point in empty:
        away = position[tree.query_ball_point(point, 4.0 * l0)] - point
        sectors = np.floor(np.arctan2(away[:, 1], away[:, 0]) / (math.pi / 4.0)).astype(int)
        inside += len(set(sectors.tolist())) == 8
    return inside


def _reference(column: str) -> Mapping[str, Curve]:
    columns = exact()
    return {"boundary elements": (columns["t omega"], columns[column])}


def _run(cells: int) -> Run:
    return Run("rotating-square", cells, (f"spacing={1.0 / cells!r}", "output.interval=0.05"))


STUDY = Study(
    number="3",
    title="Rotating square patch",
    length="L/l0",
    reference="boundary elements, error at most 1.3e-3 ρω²L²; start: series of Le Touzé et al. (2013)",
    runs=tuple(_run(n) for n in (25, 50, 100)),
    quick=(_run(25), _run(50)),
    measure=measure,
    bars=(
        Bar(PRESSURE, 0.05, cells=100, quick=(0.0, 1.0)),
        Bar(ANGULAR, 0.01, cells=100, quick=(0.0, 0.05)),
        Bar(VOIDS, 0.0, 0.0, cells=100),
    ),
    panels={
        "pressure at the centre": Panel("t ω", "p / ρω²L²", reference=lambda: _reference("p"), limits=(-0.4, 0.2)),
        "angular momentum": Panel("t ω", "angular momentum / start"),
        "distance of the corners": Panel("t ω", "r / L", reference=lambda: _reference("corner")),
    },
    orders=(PRESSURE,),
)
