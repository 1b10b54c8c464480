"""Case 7b: steep sloshing in a swaying tank (Faltinsen et al. 2000)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from spume.named import CASES
from spume.tables import read_columns
from spume.validation import Bar, Curve, Folder, Measured, Panel, Run, Study
from spume.validation.study import rms

DEPTH = 0.6
ERROR = "rms of the elevation / largest measured one"


def measured() -> Curve:
    """Return time [s] and elevation [m] of the experiment."""
    t, eta = read_columns(CASES / "sway-sloshing" / "elevation.csv")[0].values()
    return t, eta


def measure(folder: Folder) -> Measured:
    """Return the error of the elevation at the probe, at the measured instants."""
    gauge = folder.gauge("probe")
    t, eta = gauge["time"], gauge["elevation"] - DEPTH
    times, surface = measured()
    inside = times <= t[-1]
    error = (np.interp(times, t, eta) - surface)[inside]
    amplitude = float(np.abs(surface).max())
    volume = folder.gauge("volume")["volume"]
    return Measured(
        {
            ERROR: rms(error) / amplitude,
            "volume, last / first − 1": float(volume[-1] / volume[1] - 1.0),
            "measured instants reached": float(inside.sum()),
        },
        {"elevation 0.05 m from the wall": (t, eta)},
    )


def _reference() -> Mapping[str, Curve]:
    return {"measured (points)": measured()}


def _run(cells: int, end: float = 9.5) -> Run:
    return Run("sway-sloshing", cells, (f"spacing={DEPTH / cells!r}", f"time.end={end!r}", "output.frames=false"))


STUDY = Study(
    number="7b",
    title="Steep sloshing in a swaying tank",
    length="h/l0",
    reference="Faltinsen et al. (2000), h = 0.6 m, T = 1.3 s, sway 0.032 m (their figure 7, read at some instants)",
    runs=tuple(_run(n) for n in (15, 30, 60)),
    quick=(_run(12, 2.6),),
    measure=measure,
    bars=(Bar(ERROR, 0.08, cells=60, quick=(0.0, 0.5)),),
    panels={"elevation 0.05 m from the wall": Panel("t [s]", "η [m]", reference=_reference)},
    orders=(ERROR,),
)
