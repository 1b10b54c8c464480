"""Case 2: the decay of Taylor-Green vortices."""

from __future__ import annotations

import math

import numpy as np

from spume.validation import Bar, Folder, Measured, Panel, Run, Study

ERROR = "‖u − u_exact‖₂ / ‖u_exact‖₂ at tU/L = 2"
ENERGY = "kinetic energy / exact − 1 at tU/L = 2"


def measure(folder: Folder) -> Measured:
    """Return the error of the velocity over all particles, where they are."""
    viscosity = folder.case.fluid[0].viscosity
    series = []
    for frame in folder.frames():
        x, y = (2.0 * math.pi * frame["position"]).T
        exact = np.stack([-np.cos(x) * np.sin(y), np.sin(x) * np.cos(y)], axis=1)
        exact *= math.exp(-8.0 * math.pi**2 * viscosity * frame.time)
        error = math.sqrt(((frame["velocity"] - exact) ** 2).sum() / (exact**2).sum())
        series.append((frame.time, error, (frame["velocity"] ** 2).sum() / (exact**2).sum()))
    table = np.array(series)
    return Measured(
        {ERROR: float(table[-1, 1]), ENERGY: float(table[-1, 2] - 1.0)},
        {"error of the velocity": (table[1:, 0], table[1:, 1]), "kinetic energy": (table[:, 0], table[:, 2])},
    )


def _run(reynolds: int, cells: int) -> Run:
    settings = (f"spacing={1.0 / cells!r}", f"fluid.liquid.viscosity={1.0 / reynolds!r}", "output.interval=0.05")
    return Run("taylor-green", cells, settings, f"Re {reynolds}")


STUDY = Study(
    number="2",
    title="Taylor–Green vortices in a periodic box",
    length="L/l0",
    reference="exact solution of the Navier–Stokes equations (Taylor & Green 1937)",
    runs=tuple(_run(re, n) for re in (100, 1000) for n in (25, 50, 100)),
    quick=(_run(100, 25), _run(100, 50)),
    measure=measure,
    bars=(
        Bar(ERROR, 0.01, series="Re 100", cells=100, quick=(0.0, 0.2)),
        Bar(ERROR, 0.03, series="Re 1000", cells=100),
        Bar(f"order: {ERROR}", lower=1.0, series="Re 100"),
        Bar(f"order: {ERROR}", lower=1.0, series="Re 1000"),
    ),
    panels={
        "error of the velocity": Panel("t U/L", "‖u − u_exact‖₂ / ‖u_exact‖₂", log=True),
        "kinetic energy": Panel("t U/L", "kinetic energy / exact"),
    },
    orders=(ERROR,),
)
