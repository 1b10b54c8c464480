"""Case 7c: linear sloshing in a tank that starts to sway."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial

import numpy as np
from numpy.typing import NDArray

from spume.validation import Bar, Curve, Folder, Measured, Panel, Run, Study
from spume.validation.study import rms

G, LENGTH, DEPTH, A = 9.81, 1.0, 0.5, 1e-3
FIRST = math.sqrt(G * math.pi / LENGTH * math.tanh(math.pi * DEPTH / LENGTH))
OMEGA = 0.7 * FIRST
ERROR = "rms of the elevation at the walls / largest exact one, 5 s"
PERIOD = "|first eigenperiod / exact − 1|"


def exact(t: NDArray[np.float64], side: float) -> NDArray[np.float64]:
    """Return the elevation [m] at the left (side = 0) or right (1) wall of a tank that sways by A sin(omega t),
    at times t [s] of shape (n,).

    Odd modes cos(k_n x), k_n = n pi/L, omega_n^2 = g k_n tanh(k_n h), of the water at rest before (Faltinsen 1978):
    b_n'' + omega_n^2 b_n = P_n x_t'', P_n = 4 tanh(k_n h)/(n pi), the jump of x_t' counted as well.
    """
    total = np.zeros_like(t)
    for n in range(1, 40, 2):
        k = n * math.pi / LENGTH
        tanh = math.tanh(k * DEPTH)
        own = math.sqrt(G * k * tanh)
        strength = 4.0 * tanh / (n * math.pi)
        # A forced part c sin(omega t), and a free one that starts with the impulse.
        forced = -strength * A * OMEGA**2 / (own**2 - OMEGA**2)
        free = (strength * A * OMEGA - forced * OMEGA) / own
        total += (forced * np.sin(OMEGA * t) + free * np.sin(own * t)) * math.cos(k * side * LENGTH)
    return total


def measure(folder: Folder) -> Measured:
    """Return the error at both walls, and the first eigenperiod that fits the difference of the two elevations."""
    errors, values, curves = [], {}, {}
    for name, side in (("left", 0.0), ("right", 1.0)):
        gauge = folder.gauge(name)
        t, eta = gauge["time"], gauge["elevation"] - DEPTH
        values[name] = eta
        errors.append(eta - exact(t, side))
        curves[f"{name} wall"] = (t, eta / A)
    scale = float(np.abs(exact(t, 0.0)).max())
    found = fitted_frequency(t, values["left"] - values["right"])
    return Measured({ERROR: rms(np.concatenate(errors)) / scale, PERIOD: abs(FIRST / found - 1.0)}, curves)


def fitted_frequency(t: NDArray[np.float64], eta: NDArray[np.float64]) -> float:
    """Return the frequency near the first one that fits best, beside the forced one and the third mode [rad/s].

    Times [s] and elevations [m] have the shape (n,).
    """
    from scipy.optimize import minimize_scalar

    third = math.sqrt(3.0 * math.pi * G / LENGTH * math.tanh(3.0 * math.pi * DEPTH / LENGTH))

    def left_over(omega: float) -> float:
        waves = [wave(w * t) for w in (omega, OMEGA, third) for wave in (np.sin, np.cos)]
        basis = np.column_stack([*waves, np.ones_like(t)])
        return float(np.square(basis @ np.linalg.lstsq(basis, eta, rcond=None)[0] - eta).sum())

    return float(minimize_scalar(left_over, bounds=(0.93 * FIRST, 1.07 * FIRST), method="bounded").x)


def _reference(side: float) -> Mapping[str, Curve]:
    t = np.linspace(0.0, 5.0, 1001)
    return {"linear theory": (t, exact(t, side) / A)}


def _run(cells: int) -> Run:
    return Run("linear-sway", cells, (f"spacing={DEPTH / cells!r}", "output.frames=false"))


STUDY = Study(
    number="7c",
    title="Linear sloshing in a swaying tank, amplitude L/1000, ω = 0.7 ω₁",
    length="h/l0",
    reference="linear potential theory (Faltinsen 1978), started with a jump of the velocity",
    runs=tuple(_run(n) for n in (25, 50, 125)),
    quick=(_run(12),),
    measure=measure,
    bars=(
        # The bars name no resolution. At h/l0 = 12 the waves are a fortieth of a spacing high: what the surface does by
        # itself is larger.
        Bar(PERIOD, 0.002, cells=125),
        Bar(ERROR, 0.02, cells=125, quick=(0.0, 4.0)),
    ),
    panels={
        f"{name} wall": Panel("t [s]", "η / A", reference=partial(_reference, side))
        for name, side in (("left", 0.0), ("right", 1.0))
    },
    orders=(ERROR, PERIOD),
)
