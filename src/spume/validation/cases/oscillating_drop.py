"""Case 4, second part: a drop that oscillates under a central force."""

from __future__ import annotations

import math

import numpy as np

from spume.validation import Bar, Folder, Measured, Panel, Run, Study
from spume.validation.cases.elliptical_drop import semi_axis, solution

PERIOD = 4.827343
AXIS = "error of the largest semi-axis in the first period"
TIME = "error of the period, mean of those run"
LOSS = "energy lost a period"


def measure(folder: Folder) -> Measured:
    """Return amplitude, period (from crossings of a = R) and loss of energy (from that above the drop at rest)."""
    energy = folder.gauge("energy")
    t, a = semi_axis(folder)
    times, exact = solution(1.0, 1.0, 3.2 * PERIOD)
    first = t <= PERIOD
    # The axis passes R upwards once a period.
    difference = a - 1.0
    rising = np.flatnonzero((difference[:-1] <= 0.0) & (difference[1:] > 0.0) & (t[:-1] > 0.5 * PERIOD))
    width, height = t[rising + 1] - t[rising], difference[rising + 1] - difference[rising]
    crossings = t[rising] - difference[rising] * width / height
    periods = crossings[-1] / round(crossings[-1] / PERIOD) if len(crossings) else math.nan
    # The energy of the disk at rest is M R^2/4 in units of omega^2; what is above it is that of the oscillation.
    rest = energy["potential"][0]
    excess = (energy["total"] - rest) / (energy["total"][0] - rest)
    count = t[-1] / PERIOD
    return Measured(
        {
            AXIS: float(a[first].max() / exact[times <= PERIOD].max() - 1.0),
            TIME: float(periods / PERIOD - 1.0),
            LOSS: float((1.0 - excess[-1]) / count),
        },
        {"semi-axis along y": (t, a), "energy of the oscillation": (energy["time"], excess)},
    )


def _run(cells: int) -> Run:
    return Run("oscillating-drop", cells, (f"spacing={1.0 / cells!r}", "output.interval=0.02"))


STUDY = Study(
    number="4b",
    title="Oscillating drop under a central force",
    length="R/l0",
    reference="ordinary differential equations (after Monaghan 1994), period 4.827343/ω; three periods",
    runs=tuple(_run(n) for n in (12, 25, 50)),
    quick=(_run(12),),
    measure=measure,
    bars=(
        Bar(AXIS, 0.005, -0.005, cells=50, quick=(-0.1, 0.1)),
        Bar(TIME, 0.005, -0.005, cells=50, quick=(-0.05, 0.05)),
        Bar(LOSS, 0.02, -0.02, cells=50, quick=(-0.2, 0.3)),
    ),
    panels={
        "semi-axis along y": Panel("t ω", "a / R", reference=lambda: {"exact": solution(1.0, 1.0, 3.2 * PERIOD)}),
        "energy of the oscillation": Panel("t ω", "energy above rest / start"),
    },
    orders=(AXIS, TIME),
)
