"""The six problems of the atlas: small runs of validation cases, with one error each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from spume.atlas.measures import of_frames, temporal_noise
from spume.validation.cases import (
    dam_break,
    elliptical_drop,
    hydrostatic,
    rotating_square,
    standing_wave,
    taylor_green,
)
from spume.validation.folder import Folder, budgets
from spume.validation.study import rms, rms_over_time


@dataclass(frozen=True)
class Problem:
    """A problem that every combination of models is run on.

    Attributes:
        name: for tables.
        case: built-in case.
        cells: resolution.
        settings: keys replaced.
        error: gives the error that is compared, from the run's folder.
        meaning: what the error is.
        scale: pressure that noise is relative to [Pa], and its name.
        gauge: pressure gauge with a value at every step; none where it is empty.
    """

    name: str
    case: str
    cells: int
    settings: tuple[str, ...]
    error: Callable[[Folder], float]
    meaning: str
    scale: tuple[float, str]
    gauge: str = ""


def measure(problem: Problem, folder: Folder) -> dict[str, float]:
    """Return everything that the atlas says of a run."""
    found = {"error": problem.error(folder), **of_frames(folder, problem.scale[0])}
    if problem.gauge:
        values = folder.gauge(problem.gauge)["pressure"]
        found["noise in time"] = temporal_noise(values[len(values) // 2 :]) / problem.scale[0]
    sums = budgets(folder)
    found["volume"] = sums["volume, last change"]
    found["energy"] = sums["energy, last change / largest kinetic"]
    found["iterations"] = folder.summary["pressure_iterations_mean"] or 0.0
    found["cost"] = folder.summary["us_per_fluid_particle_step"]
    return found


def _rest(folder: Folder) -> float:
    """Rms of the pressure over the later half, from the surface l0/2 above the top centres."""
    errors = []
    for frame in folder.frames():
        if frame.time < 0.5 * folder.case.time.end:
            continue
        y, p = frame["position"][:, -1], frame["pressure"]
        surface = np.sort(y)[-round(0.5 / frame.spacing) :].mean() + frame.spacing / 2
        errors.append(rms(p - hydrostatic.RHO * hydrostatic.G * (surface - y)))
    return rms(errors) / (hydrostatic.RHO * hydrostatic.G * hydrostatic.H)


def _vortices(folder: Folder) -> float:
    return taylor_green.measure(folder).metrics[taylor_green.ERROR]


def _square(folder: Folder) -> float:
    gauge, exact = folder.gauge("centre"), rotating_square.exact()
    t, p = gauge["time"][1:], gauge["pressure"][1:] / rotating_square.RHO
    return rms(p - np.interp(t, exact["t omega"], exact["p"])) / rotating_square.START


def _drop(folder: Folder) -> float:
    return elliptical_drop.measure(folder).metrics[elliptical_drop.AXIS]


def _wave(folder: Folder) -> float:
    """Rms of the elevation at crest and trough over the amplitude."""
    times, *surface = standing_wave.potential_flow(0.1)
    a = 0.1 / standing_wave.K
    errors = []
    for name, exact in zip(("crest", "trough"), surface, strict=True):
        gauge = folder.gauge(name)
        errors.append((gauge["elevation"] - standing_wave.DEPTH - np.interp(gauge["time"], times, exact)) / a)
    return rms(np.concatenate(errors))


def _break(folder: Folder) -> float:
    """Mean over the sensors of the rms over time of the pressure over rho g H, as far as the run goes."""
    found = [
        rms_over_time(dam_break.pressure(folder, k), dam_break.built_in(k), dam_break.WINDOW)
        for k in range(1, len(dam_break.PRESSURES) + 1)
    ]
    return float(np.mean(found))


PROBLEMS = (
    Problem(
        "at rest", "hydrostatic", 16, ("spacing=0.0625", "time.end=2.0", "output.interval=0.1"),
        _rest, "rms of the pressure / ρgH", (9810.0, "ρgH"), "bottom",
    ),
    Problem(
        "vortices", "taylor-green", 20, ("spacing=0.05", "time.end=1.0", "output.interval=0.1"),
        _vortices, "error of the velocity at t = L/U", (1000.0, "ρU²"),
    ),
    Problem(
        "square", "rotating-square", 20, ("spacing=0.05", "time.end=1.5", "output.interval=0.1", "tensile=false"),
        _square, "rms of the pressure at the centre / its start", (1000.0, "ρω²L²"), "centre",
    ),
    Problem(
        "drop", "elliptical-drop", 12, (f"spacing={1.0 / 12!r}", "output.interval=0.0004"),
        _drop, "largest error of the long axis", (1e7, "ρA²R²"), "centre",
    ),
    Problem(
        "wave", "standing-wave", 10, ("spacing=0.1", "time.end=2.32", "output.interval=0.1"),
        _wave, "rms of the elevation / amplitude, two periods", (9810.0, "ρgh"),
    ),
    Problem(
        "dam break", "dam-break", 15,
        ("spacing=0.02", "time.end=0.6", "output.interval=0.05"),
        _break, "mean rms of the pressures over time / ρgH, to t√(g/H) = 3.4", (2943.0, "ρgH"), "pressure-2",
    ),
)  # fmt: skip
"""The problems, in the order of the tables."""
