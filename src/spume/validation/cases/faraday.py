"""Case 7d: Faraday waves."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from spume.validation import Bar, Curve, Folder, Measured, Panel, Run, Study

G, LENGTH, DEPTH, START, STRENGTH = 9.81, 1.0, 0.5, 0.005, 0.5
FIRST = math.sqrt(G * math.pi / LENGTH * math.tanh(math.pi * DEPTH / LENGTH))
RATIOS = {"growing": 0.5, "stable": 1.253}
"""First eigenfrequency over that of the tank."""
ENDS = {"growing": 3.6, "stable": 6.0}
GROWTH, LARGEST = "growth rate / exact − 1", "largest amplitude / exact − 1"


@cache
def mathieu(series: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times [s] and b(t)/b(0) of b'' + omega_1^2 (1 - (a Omega^2/g) cos Omega t) b = 0, b'(0) = 0."""
    from scipy.integrate import solve_ivp

    omega = FIRST / RATIOS[series]
    times = np.linspace(0.0, ENDS[series] * 1.01, 3000)

    def change(t: float, b: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.array([b[1], -(FIRST**2) * (1.0 - STRENGTH * math.cos(omega * t)) * b[0]])

    found = solve_ivp(change, (0.0, times[-1]), [1.0, 0.0], t_eval=times, rtol=1e-9, atol=1e-12)
    return times, found.y[0]


def measure(folder: Folder) -> Measured:
    """Return the growth of the first mode, half the difference of the elevations at the two walls."""
    left, right = folder.gauge("left"), folder.gauge("right")
    t, mode = left["time"], 0.5 * (left["elevation"] - right["elevation"]) / START
    series = min(RATIOS, key=lambda name: abs(ENDS[name] - folder.case.time.end))
    times, exact = mathieu(series)
    metrics = {LARGEST: float(np.abs(mode).max() / np.abs(exact[times <= t[-1]]).max() - 1.0)}
    if series == "growing":
        metrics[GROWTH] = _rate(t, mode) / _rate(times[times <= t[-1]], exact[times <= t[-1]]) - 1.0
    return Measured(metrics, {f"first mode, {series}": (t, mode)})


def _rate(t: NDArray[np.float64], mode: NDArray[np.float64]) -> float:
    """Return the slope of the logarithm of the largest value in each half period of the wave [1/s]."""
    half = math.pi / FIRST
    count = int(t[-1] / half + 0.25)
    peaks = []
    for n in range(1, count):
        near = np.abs(t - n * half) < 0.5 * half
        size = np.abs(mode[near])
        peaks.append((t[near][size.argmax()], math.log(size.max())))
    times, sizes = np.array(peaks).T
    return float(np.polyfit(times, sizes, 1)[0])


def _reference(series: str) -> Mapping[str, Curve]:
    return {"Mathieu": mathieu(series)}


def _run(series: str, cells: int) -> Run:
    omega = FIRST / RATIOS[series]
    size, period = STRENGTH * G / omega**2, 2.0 * math.pi / omega
    motion = f"{{kind='sinusoid', amplitude=[0.0, {size!r}], period={period!r}, phase_deg=90.0}}"
    settings = (
        f"spacing={DEPTH / cells!r}",
        f"time.end={ENDS[series]!r}",
        f"domain.motion={motion}",
        "output.frames=false",
    )
    return Run("faraday", cells, settings, series)


STUDY = Study(
    number="7d",
    title="Faraday waves, aΩ²/g = 0.5",
    length="h/l0",
    reference="Mathieu's equation of the first mode (Benjamin & Ursell 1954), ω₁/Ω = 0.5 (grows) and 1.253 (does not)",
    runs=(*(_run("growing", n) for n in (12, 25, 50)), *(_run("stable", n) for n in (12, 25))),
    quick=(_run("growing", 12),),
    measure=measure,
    bars=(
        Bar(GROWTH, 0.05, -0.05, series="growing", cells=50, quick=(-0.5, 0.5)),
        Bar(LARGEST, 0.05, -1.0, series="stable", cells=50),
    ),
    panels={f"first mode, {s}": Panel("t [s]", "b / b(0)", reference=partial(_reference, s)) for s in RATIOS},
    orders=(GROWTH,),
)
