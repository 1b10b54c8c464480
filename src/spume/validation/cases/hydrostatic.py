"""Case 1: water at rest, in 2D. `of` gives the same for another dimension."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from spume.validation import Bar, Folder, Measured, Panel, Run, Study
from spume.validation.study import rms

G, H, RHO = 9.81, 1.0, 1000.0
PRESSURE = "rms(p − ρg(H−y)) / ρgH, t√(g/H) = 10 … 50"
KINETIC = "largest kinetic energy / ρgH² area, t√(g/H) = 10 … 50"
VOLUME = "drift of the volume, t√(g/H) = 10 … 50"
LOST = "particles lost"


def measure(folder: Folder, area: float) -> Measured:
    """Return errors of the pressure, kinetic energy and volume from t sqrt(g/H) = 10 on.

    The surface is the plane l0/2 above the mean of the top centres, as many as a layer has. The volume is the mean of
    n0/n over the rows deeper than 2.5 l0, relative to its first value in the interval.
    """
    series = []
    for frame in folder.frames():
        l0, d = frame.spacing, frame.dimension
        y, p, u, n = frame["position"][:, -1], frame["pressure"], frame["velocity"], frame["number_density"]
        tops = round(area / l0 ** (d - 1))
        surface = np.sort(y)[-tops:].mean() + l0 / 2
        error = rms(p - RHO * G * (surface - y)) / (RHO * G * H)
        kinetic = 0.5 * RHO * l0**d * float((u**2).sum()) / (RHO * G * H**2 * area)
        deep = y < surface - 2.5 * l0
        volume = float(np.mean(1.0 / n[deep])) if frame.time > 0.0 else math.nan
        series.append((frame.time * math.sqrt(G / H), error, kinetic, volume))
    table = np.array(series)
    late = table[table[:, 0] >= 10.0]
    fluid = folder.log["particles_fluid"]
    return Measured(
        {
            PRESSURE: rms(late[:, 1]),
            KINETIC: float(late[:, 2].max()),
            VOLUME: float(np.abs(late[:, 3] / late[0, 3] - 1.0).max()),
            LOST: float(fluid[0] - fluid[-1]),
        },
        {
            "pressure": (table[1:, 0], table[1:, 1]),
            "kinetic energy": (table[1:, 0], np.maximum(table[1:, 2], 1e-12)),
        },
    )


def of(case: str, number: str, area: float, sizes: tuple[int, ...], quick: tuple[int, ...], limit: float) -> Study:
    """Return the study of one dimension, at H/l0 = sizes."""

    def run(cells: int, end: float = 16.0) -> Run:
        fields = "output.fields=['velocity', 'pressure', 'number_density', 'kind']"
        return Run(case, cells, (f"spacing={H / cells!r}", f"time.end={end!r}", "output.interval=0.064", fields))

    return Study(
        number=number,
        title=f"Water at rest in a tank, {'3D' if '3d' in case else '2D'}, from a lattice disturbed by 10 % of l0",
        length="H/l0",
        reference="p = ρ g (H − y), exact",
        runs=tuple(run(n) for n in sizes),
        quick=tuple(run(n, 6.4) for n in quick),
        measure=partial(measure, area=area),
        bars=(
            Bar(PRESSURE, 0.005, cells=40, quick=(0.0, limit)),
            Bar(KINETIC, 1e-6, cells=40, quick=(0.0, 1e-3)),
            Bar(VOLUME, 1e-3, cells=40, quick=(0.0, 0.02)),
            Bar(f"order: {PRESSURE}", lower=1.0),
            Bar(LOST, 0.0, 0.0, quick=(0.0, 0.0)),
        ),
        panels={
            "pressure": Panel("t √(g/H)", "rms pressure error / ρgH", log=True, line=0.005),
            "kinetic energy": Panel("t √(g/H)", "kinetic energy / ρgH² area", log=True, line=1e-6),
        },
        orders=(PRESSURE,),
    )


STUDY = of("hydrostatic", "1", 0.5, (10, 20, 40), (10, 20), 0.01)
