"""Case 4: the elliptical drop (Monaghan 1994). `solution` also serves the oscillating drop."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

from spume.validation import Bar, Curve, Folder, Measured, Panel, Run, Study
from spume.validation.study import rms

RATE, END = 100.0, 0.0076
AXIS = "largest error of the long semi-axis"
LOSS = "energy lost"


@cache
def solution(rate: float, stiffness: float, end: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times [s] and the semi-axis a [m] along y of a disk of radius 1 m strained by (-A x, A y).

    u = (-A x, A y) with a' = A a, and from p = 0 on the ellipse with semi-axes 1/a and a
    A' = (A^2 + W) (1 - a^4)/(1 + a^4) with the central force -W r (Monaghan 1994 for W = 0).
    """
    from scipy.integrate import solve_ivp

    def change(_: float, state: NDArray[np.float64]) -> NDArray[np.float64]:
        strain, axis = state
        ratio = (1.0 - axis**4) / (1.0 + axis**4)
        return np.array([(strain**2 + stiffness) * ratio, strain * axis])

    times = np.linspace(0.0, end, 2001)
    found = solve_ivp(change, (0.0, end), [rate, 1.0], t_eval=times, rtol=1e-10, atol=1e-12)
    return times, found.y[1]


def semi_axis(folder: Folder) -> Curve:
    """Return times [s] and the semi-axis along y [m]: 1 m and what the outermost centre has moved since the start."""
    times, tops = [], []
    for frame in folder.frames():
        times.append(frame.time)
        tops.append(float(frame["position"][:, 1].max()))
    a = np.array(tops)
    return np.array(times), a - a[0] + 1.0


def measure(folder: Folder) -> Measured:
    """Return the error of the long semi-axis and the loss of kinetic energy, which the exact drop keeps."""
    times, axis = solution(RATE, 0.0, 1.05 * END)
    energy = folder.gauge("energy")
    t, a = semi_axis(folder)
    error = a / np.interp(t, times, axis) - 1.0
    return Measured(
        {
            AXIS: float(np.abs(error).max()),
            "rms error of the long semi-axis": rms(error),
            LOSS: float(1.0 - energy["total"][-1] / energy["total"][0]),
        },
        {
            "long semi-axis": (RATE * t, a),
            "energy": (RATE * energy["time"], energy["total"] / energy["total"][0]),
        },
    )


def _run(cells: int) -> Run:
    return Run("elliptical-drop", cells, (f"spacing={1.0 / cells!r}", "output.interval=0.0002"))


STUDY = Study(
    number="4a",
    title="Elliptical drop",
    length="R/l0",
    reference="ordinary differential equations of Monaghan (1994); axes count from the outermost centre at the start",
    runs=tuple(_run(n) for n in (12, 25, 50)),
    quick=(_run(12), _run(25)),
    measure=measure,
    bars=(
        Bar(AXIS, 0.005, cells=50, quick=(0.0, 0.1)),
        Bar(LOSS, 0.02, -0.02, cells=50, quick=(-0.1, 0.1)),
    ),
    panels={
        "long semi-axis": Panel(
            "A t",
            "a / R",
            reference=lambda: {"exact": (RATE * (s := solution(RATE, 0.0, END))[0], s[1])},
        ),
        "energy": Panel("A t", "energy / start"),
    },
    orders=(AXIS,),
)
