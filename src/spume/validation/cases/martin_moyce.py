"""Case 6a: the front of a collapsing column (Martin & Moyce 1952)."""

from __future__ import annotations

import math

import numpy as np

from spume.named import CASES
from spume.tables import read_columns
from spume.validation import Bar, Curve, Folder, Measured, Panel, Run, Study

G, A = 9.81, 0.05715
MEAN, LARGEST, SHIFT = "mean error of the front, to t√(2g/a) = 6", "largest error of the front", "shift of the origin"


def measured() -> Curve:
    """Return T and Z of the experiment."""
    columns, _ = read_columns(CASES / "dam-break-martin-moyce" / "front.csv")
    return columns["T"], columns["Z"]


def measure(folder: Folder) -> Measured:
    """Return relative errors of the front, after the shift of the origin of time that makes their mean smallest."""
    front = folder.gauge("front")
    t, x = front["time"] * math.sqrt(2 * G / A), front["front"] / A
    times, places = measured()
    inside = times < t[-1] - 0.5
    best = (math.inf, math.inf, 0.0)
    for shift in np.linspace(-0.5, 0.5, 101):
        error = np.abs(np.interp(times[inside] + shift, t, x) / places[inside] - 1.0)
        best = min(best, (float(error.mean()), float(error.max()), float(shift)))
    return Measured({MEAN: best[0], LARGEST: best[1], SHIFT: best[2]}, {"front on the floor": (t - best[2], x)})


def _run(cells: int) -> Run:
    return Run("dam-break-martin-moyce", cells, (f"spacing={A / cells!r}", "time.end=0.35", "output.frames=false"))


STUDY = Study(
    number="6a",
    title="Front of a collapsing column",
    length="a/l0",
    reference="Martin & Moyce (1952), a = 2.25 in, n² = 2; the shift of their origin of time is fitted",
    runs=tuple(_run(n) for n in (12, 25, 50)),
    quick=(_run(12), _run(25)),
    measure=measure,
    bars=(
        Bar(MEAN, 0.05, cells=50, quick=(0.0, 0.05)),
        Bar(LARGEST, 0.12, cells=50, quick=(0.0, 0.12)),
    ),
    panels={
        "front on the floor": Panel("t √(2g/a)", "x / a", reference=lambda: {"measured (points)": measured()}),
    },
    orders=(MEAN,),
)
