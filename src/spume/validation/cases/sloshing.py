"""Case 7a: sloshing with lateral impact, SPHERIC test 10."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from spume.validation import Bar, Curve, Folder, Measured, Panel, Run, Study
from spume.validation.study import reference_file, table

DEPTH = 0.093
MEASURED = ((3710.0, 730.0), (4820.0, 1500.0), (4690.0, 1710.0), (4640.0, 1320.0))
"""Mean and standard deviation of the first four peaks over 100 repetitions [Pa]."""
IMPACTS = (2.375, 4.067, 5.672, 7.303)
"""Times of the peaks of the one run whose series is published [s]."""
TIME = "|time between impacts / measured − 1|"
LOST = "particles lost"


def measure(folder: Folder) -> Measured:
    """Return the largest value of the left sensor within 0.4 s of each impact, as computed at every step."""
    gauge = folder.gauge("left")
    t, p = gauge["time"], gauge["pressure"]
    metrics: dict[str, float] = {}
    times = []
    for k, instant in enumerate(IMPACTS, start=1):
        near = np.abs(t - instant) < 0.4
        if t[-1] < instant + 0.4:  # a run that was not to come so far
            break
        metrics[f"peak {k} [Pa]"] = float(p[near].max())
        metrics[f"peak {k}, mean over 10 ms [Pa]"] = lasting(t, p, instant)
        times.append(float(t[near][p[near].argmax()]))
    measured = (IMPACTS[-1] - IMPACTS[0]) / 3
    if len(times) == len(IMPACTS):
        metrics[TIME] = abs((times[-1] - times[0]) / 3 / measured - 1.0)
    fluid = folder.log["particles_fluid"]
    metrics[LOST] = float(fluid[0] - fluid[-1])
    return Measured(metrics, {"left wall, 93 mm above the floor": (t, p)})


def lasting(t: np.ndarray, p: np.ndarray, instant: float, duration: float = 0.01) -> float:
    """Return the largest mean [Pa] over a duration [s] around an impact: what the largest single value hides.

    Times t [s] and pressures p [Pa] have the shape (n,).
    """
    fine = np.arange(instant - 0.4, instant + 0.4, 0.0005)
    n = round(duration / 0.0005)
    return float(np.convolve(np.interp(fine, t, p), np.ones(n) / n, "valid").max())


def _reference() -> Mapping[str, Curve]:
    found: dict[str, Curve] = {
        "mean of 100 (points)": (np.array(IMPACTS), np.array([mean for mean, _ in MEASURED])),
    }
    path = reference_file("07_sloshing/spheric10_lateral_water_pressure.csv")
    if path is not None:
        t, p = table(path).T
        found["one experiment"] = (t, p)
    return found


def _limits(k: int) -> tuple[float, float]:
    mean, deviation = MEASURED[k]
    width = deviation if k == 0 else 2 * deviation
    return mean + width, mean - width


def of(case: str, number: str, sizes: tuple[int, ...], quick: tuple[int, ...]) -> Study:
    """Return the study of one dimension; quick runs end after the first impact."""

    def run(cells: int, end: float = 8.3) -> Run:
        return Run(case, cells, (f"spacing={DEPTH / cells!r}", f"time.end={end!r}", "output.frames=false"))

    return Study(
        number=number,
        title=f"Sloshing with lateral impact, SPHERIC test 10, {'3D' if case.endswith('3d') else '2D'}",
        length="depth/l0",
        reference="Souto-Iglesias et al. (2011), 100 repetitions: first peak ± 1 SD, others ± 2 SD; no filter",
        runs=tuple(run(n) for n in sizes),
        quick=tuple(run(n, 2.8) for n in quick),
        measure=measure,
        bars=(
            Bar("peak 1 [Pa]", *_limits(0), cells=31, quick=(500.0, 40000.0)),
            *(Bar(f"peak {k + 1} [Pa]", *_limits(k), cells=31) for k in range(1, 4)),
            Bar(TIME, 0.02, cells=31),
            Bar(LOST, 0.0, 0.0, cells=31, quick=(0.0, 0.0)),
        ),
        panels={
            "left wall, 93 mm above the floor": Panel(
                "t [s]", "p [Pa]", reference=_reference, limits=(-500.0, 15000.0)
            ),
        },
    )


STUDY = of("sloshing", "7a", (8, 15, 31), (5,))
