"""Case 6b: pressures and levels of a dam break (Lobovsky et al. 2014). `of` gives the same in 3D."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

from spume.named import CASES
from spume.tables import read_columns
from spume.validation import Bar, Curve, Folder, Measured, Panel, Run, Study
from spume.validation.study import mean_over_time, reference_file, rms_over_time, table

G, H, RHO = 9.81, 0.3, 1000.0
HEIGHTS = (3, 15, 30, 80)
PRESSURES = tuple(f"rms of the pressure at z = {z} mm / ρgH, t√(g/H) = 2.45 … 5.3" for z in HEIGHTS)
LEVELS = tuple(f"rms of level {k} / H" for k in range(1, 5))
WINDOW = (2.45, 5.3)
PEAK = "peak at z = 15 mm / ρgH"


def _series(sensor: int) -> Curve | None:
    path = reference_file(f"06_dambreak/lobovsky2014_H300_sensor{sensor}_pressure.csv")
    if path is None:
        return None
    t, p = table(path).T
    return t, p


def built_in(sensor: int) -> Curve:
    """Return what the built-in case carries of the measured series, in the units of the experiment."""
    t, p = list(read_columns(CASES / "dam-break" / f"pressure-{sensor}.csv")[0].values())[:2]
    return t, p


def reference(sensor: int) -> Curve:
    """Return the full measured series where it is at hand, else that of the built-in case."""
    return _series(sensor) or built_in(sensor)


def pressure(folder: Folder, sensor: int) -> Curve:
    """Return the computed series of a sensor in the units of the experiment, shifted as the case's comparison found."""
    (shift,) = (e["shift"] for e in folder.summary["comparison"] if e["gauge"] == f"pressure-{sensor}")
    gauge = folder.gauge(f"pressure-{sensor}")
    return gauge["time"] * math.sqrt(G / H) + shift, gauge["pressure"] / (RHO * G * H)


def measure(folder: Folder) -> Measured:
    """Return what the case's own comparison found, and how far pressures are off over time.

    The rms over time is that of every step against the full series, or the built-in table where that is not at hand.
    The instants of the table are close where the pressure changes fast: a quarter of them lie in a tenth of the time.
    """
    found = {entry["gauge"]: entry for entry in folder.summary["comparison"]}
    # The largest single value of the whole run: the case's own peak leaves out what comes before t√(g/H) = 2.45.
    peaks = [float(folder.gauge(f"pressure-{k}")["pressure"].max()) / (RHO * G * H) for k in (1, 2)]
    metrics = {PEAK: peaks[1], "peak at z = 3 mm / ρgH": peaks[0]}
    metrics["peak at z = 15 mm / ρgH, from t√(g/H) = 2.45 on"] = found["pressure-2"]["peak"]
    curves: dict[str, Curve] = {}
    for k, name in enumerate(PRESSURES, start=1):
        z = f"z = {HEIGHTS[k - 1]} mm"
        curves[z] = pressure(folder, k)
        metrics[name] = rms_over_time(curves[z], reference(k), WINDOW)
        metrics[f"mean difference at {z} / ρgH"] = mean_over_time(curves[z], reference(k), WINDOW)
        metrics[f"{name}, at the instants of the built-in table"] = found[f"pressure-{k}"]["rms"]
    for k, name in enumerate(LEVELS, start=1):
        if f"level-{k}" in found:
            metrics[name] = found[f"level-{k}"]["rms"]
    metrics["arrival at z = 15 mm, t√(g/H)"] = found["pressure-2"]["arrival"]
    metrics["common time shift, t√(g/H)"] = found["pressure-2"]["shift"]
    return Measured(metrics, curves)


def _measured(sensor: int) -> Mapping[str, Curve]:
    full = _series(sensor)
    if full is None:
        return {"measured": built_in(sensor)}
    inside = (full[0] > 2.0) & (full[0] < 5.7)
    return {"measured": (full[0][inside], full[1][inside])}


REPEATS = 20
"""Runs at the resolution that is judged: the impact of a thin tip is chaotic, single runs scatter by 0.02 … 0.04."""


def of(case: str, number: str, sizes: tuple[int, ...], quick: tuple[int, ...], judged: bool) -> Study:
    """Return the study of one dimension; in 3D the values are reported and not judged."""

    def run(cells: int) -> Run:
        settings = (f"spacing={H / cells!r}", "time.end=1.0", "output.interval=0.1")
        return Run(case, cells, settings)

    bars = (
        Bar(PEAK, 2.03, 1.77, cells=100, quick=(0.8, 15.0)),
        *(Bar(name, 0.15, cells=100, quick=(0.0, 0.6)) for name in PRESSURES),
        *(Bar(name, 0.04, cells=100, quick=(0.0, 0.08)) for name in LEVELS),
    )
    return Study(
        number=number,
        title=f"Dam break of Lobovský et al., {'2D' if judged else '3D'}",
        length="H/l0",
        reference="Lobovský et al. (2014), J. Fluids Struct. 48, 407–434; sensors' faces of 4.2 mm, no filter, one "
        "common time shift of at most 0.1 √(H/g)",
        runs=(*(run(n) for n in sizes[:-1]), *run(sizes[-1]).repeated(REPEATS if judged else 1)),
        quick=tuple(run(n) for n in quick),
        measure=measure,
        bars=bars if judged else (),
        panels={
            f"z = {z} mm": Panel("t √(g/H)", "p / ρgH", reference=partial(_measured, k), limits=(-0.5, 3.0))
            for k, z in enumerate(HEIGHTS, start=1)
        },
        orders=PRESSURES if judged else (),
    )


STUDY = of("dam-break", "6b", (30, 60, 100), (20,), judged=True)
