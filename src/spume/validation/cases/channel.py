"""Case 9: Couette and Poiseuille flow started from rest."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from spume.validation import Bar, Folder, Measured, Panel, Run, Study
from spume.validation.study import rms

WIDTH, VISCOSITY, FORCE, LID = 1.0, 0.1, 0.8, 1.0
ERROR = "largest rms(u − series) / largest u, t ν/L² = 0.01 … 0.5"
N = np.arange(1, 200)


def couette(y: NDArray[np.float64], t: float) -> NDArray[np.float64]:
    """Return u [m/s] at heights y [m], shape (n,), at t [s]: the plate y = L moves with U (Morris et al. 1997)."""
    decay = np.exp(-VISCOSITY * (N * math.pi / WIDTH) ** 2 * t)
    waves = 2.0 * LID / (N * math.pi) * (-1.0) ** N * decay
    return LID * y / WIDTH + np.sin(np.outer(y, N) * math.pi / WIDTH) @ waves


def poiseuille(y: NDArray[np.float64], t: float) -> NDArray[np.float64]:
    """Return u [m/s] at heights y [m], shape (n,), at t [s] under a force F between plates (Morris et al. 1997)."""
    odd = 2 * N - 1
    decay = np.exp(-VISCOSITY * (odd * math.pi / WIDTH) ** 2 * t)
    waves = 4.0 * FORCE * WIDTH**2 / (VISCOSITY * math.pi**3 * odd.astype(float) ** 3) * decay
    steady = FORCE / (2.0 * VISCOSITY) * y * (WIDTH - y)
    return steady - np.sin(np.outer(y, odd) * math.pi / WIDTH) @ waves


def measure(folder: Folder) -> Measured:
    """Return the largest of the errors of the profiles, over all particles."""
    series = couette if len(folder.case.body) == 2 else poiseuille
    largest = float(np.abs(series(np.linspace(0.0, WIDTH, 101), 50.0)).max())
    errors, times = [], []
    for frame in folder.frames():
        star = frame.time * VISCOSITY / WIDTH**2
        if star < 0.0099:
            continue
        y, u = frame["position"][:, 1], frame["velocity"][:, 0]
        times.append(star)
        errors.append(rms(u - series(y, frame.time)) / largest)
    order = np.argsort(y)
    return Measured(
        {ERROR: max(errors), "rms at t ν/L² = 0.5": errors[-1]},
        {
            "error of the profile": (np.array(times), np.array(errors)),
            f"{series.__name__}, t ν/L² = 0.5": (u[order] / largest, y[order]),
        },
    )


def _run(case: str, cells: int) -> Run:
    return Run(case, cells, (f"spacing={WIDTH / cells!r}", "output.interval=0.1"), case)


STUDY = Study(
    number="9b",
    title="Couette and Poiseuille flow started from rest",
    length="L/l0",
    reference="series solutions (Morris, Fox & Zhu 1997)",
    runs=tuple(_run(case, n) for case in ("couette", "poiseuille") for n in (20, 30, 40)),
    quick=tuple(_run(case, n) for case in ("couette", "poiseuille") for n in (20,)),
    measure=measure,
    bars=tuple(Bar(ERROR, 0.005, series=case, cells=40, quick=(0.0, 0.05)) for case in ("couette", "poiseuille")),
    panels={
        "error of the profile": Panel("t ν/L²", "rms error / largest u", log=True, line=0.005),
    },
    orders=(ERROR,),
)
