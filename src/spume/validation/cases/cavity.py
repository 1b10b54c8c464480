"""Case 9: the lid-driven cavity."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from spume.named import CASES
from spume.tables import read_columns
from spume.validation import Bar, Curve, Folder, Measured, Panel, Run, Study
from spume.validation.study import rms

ERROR = "rms(u, v on the middle lines) / U"
STEADY = "change of the kinetic energy over the last tenth"
DOUBTFUL = {("v", 400, 0.9063)}
"""Values of the table that lie out of its trend: component, Reynolds number, place."""


def ghia(component: str, reynolds: int) -> Curve:
    """Return places and velocities of Ghia et al. (1982) between the walls."""
    columns = list(read_columns(CASES / "cavity" / f"{component}.csv")[0].items())
    values = dict(columns)[f"Re{reynolds}"]
    place = columns[0][1]
    keep = (place > 0.0) & (place < 1.0)
    keep &= np.array([(component, reynolds, round(float(s), 4)) not in DOUBTFUL for s in place])
    return place[keep], values[keep]


def measure(folder: Folder) -> Measured:
    """Return the error on both middle lines, of the mean over the last tenth of the run."""
    reynolds = round(1.0 / folder.case.fluid[0].viscosity)
    errors, curves = [], {}
    for index, component in enumerate("uv"):
        place, exact = ghia(component, reynolds)
        found = np.mean(
            [_on_line(f, place, index) for f in folder.frames() if f.time >= 0.9 * folder.case.time.end], axis=0
        )
        errors.append(found - exact)
        curves[f"{component}, Re {reynolds}"] = (place, found)
    energy = folder.gauge("energy")
    late = energy["kinetic"][energy["time"] >= 0.9 * folder.case.time.end]
    return Measured(
        {ERROR: rms(np.concatenate(errors)), STEADY: float(np.abs(late / late[-1] - 1.0).max())},
        curves,
    )


def _on_line(frame: object, place: NDArray[np.float64], index: int) -> NDArray[np.float64]:
    """Return u on x = 1/2 or v on y = 1/2, linear between particles and the walls."""
    from scipy.interpolate import LinearNDInterpolator

    position, velocity = frame["position"], frame["velocity"][:, index]  # type: ignore[index]
    side = np.linspace(0.0, 1.0, 101)
    walls = np.concatenate(
        [np.stack(np.broadcast_arrays(*p), -1) for p in ((side, 0.0), (side, 1.0), (0.0, side), (1.0, side))]
    )
    known = np.where((walls[:, 1] == 1.0) & (index == 0), 1.0, 0.0)
    walls, first = np.unique(walls, axis=0, return_index=True)
    points, values = np.concatenate([position, walls]), np.concatenate([velocity, known[first]])
    line = (
        np.stack([np.full_like(place, 0.5), place], -1)
        if index == 0
        else np.stack([place, np.full_like(place, 0.5)], -1)
    )
    return np.asarray(LinearNDInterpolator(points, values)(line))


def _reference(component: str, reynolds: int) -> Mapping[str, Curve]:
    return {"Ghia et al. (points)": ghia(component, reynolds)}


def _run(reynolds: int, cells: int, end: float) -> Run:
    settings = (f"spacing={1.0 / cells!r}", f"fluid.liquid.viscosity={1.0 / reynolds!r}", f"time.end={end!r}")
    return Run("cavity", cells, settings, f"Re {reynolds}")


STUDY = Study(
    number="9a",
    title="Lid-driven cavity",
    length="L/l0",
    reference="Ghia, Ghia & Shin (1982), tables I and II; one value out of the trend left out (Re 400, x = 0.9063)",
    runs=(
        *(_run(100, n, 20.0) for n in (25, 50, 100)),
        *(_run(400, n, 40.0) for n in (25, 50, 100)),
        *(_run(1000, n, 60.0) for n in (25, 50, 100)),
    ),
    quick=(_run(100, 20, 15.0),),
    measure=measure,
    bars=(
        Bar(ERROR, 0.01, series="Re 100", cells=100, quick=(0.0, 0.1)),
        Bar(ERROR, 0.01, series="Re 400", cells=100),
        Bar(ERROR, 0.01, series="Re 1000", cells=100),
    ),
    panels={
        f"{c}, Re {re}": Panel("y" if c == "u" else "x", f"{c} / U", reference=partial(_reference, c, re))
        for re in (100, 400, 1000)
        for c in "uv"
    },
    orders=(ERROR,),
)
