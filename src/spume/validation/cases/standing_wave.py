"""Case 5: a standing gravity wave."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cache, partial

import numpy as np
from numpy.typing import NDArray

from spume.validation import Bar, Curve, Folder, Measured, Panel, Run, Study
from spume.validation.study import rms

G, LENGTH, DEPTH = 9.81, 2.0, 1.0
K = 2.0 * math.pi / LENGTH
PERIOD = 2.0 * math.pi / math.sqrt(G * K * math.tanh(K * DEPTH))
END = 5.0 * PERIOD
ELEVATION = "rms of the elevation at crest and trough / a, 5 periods"
DECAY = "amplitude lost a period, beyond viscosity"


@cache
def potential_flow(steepness: float) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return times [s] and elevation [m] at x = 0 and at x = L/2 of the wave in a fluid without viscosity.

    The potential is sum_n c_n cosh k_n (z + h)/cosh k_n h cos k_n x, k_n = n k, which meets floor, walls and Laplace's
    equation exactly; c_n fit its value on the surface at twice as many points by least squares. The conditions
    eta_t = phi_z - eta_x phi_x and xi_t = -g eta - |grad phi|^2/2 + phi_z eta_t carry both on in time.
    """
    from scipy.integrate import solve_ivp

    modes, points = np.arange(12), 24
    k = K * modes
    x = (np.arange(points) + 0.5) * LENGTH / 2.0 / points
    cosine, sine = np.cos(np.outer(x, k)), np.sin(np.outer(x, k))
    to_modes = np.linalg.pinv(cosine)

    def rate(_: float, state: NDArray[np.float64]) -> NDArray[np.float64]:
        e, potential = np.split(state, 2)
        eta, slope = cosine @ e, -sine @ (k * e)
        # cosh k(eta + h)/cosh kh without large numbers
        up, down = np.exp(np.outer(eta, k)), np.exp(-np.outer(eta + 2.0 * DEPTH, k))
        share = 1.0 + np.exp(-2.0 * k * DEPTH)
        c = np.linalg.lstsq((up + down) / share * cosine, cosine @ potential, rcond=None)[0]
        vertical = ((up - down) / share * cosine) @ (k * c)
        along = -((up + down) / share * sine) @ (k * c)
        rising = vertical - slope * along
        changing = -G * eta - 0.5 * (along**2 + vertical**2) + vertical * rising
        return np.concatenate([to_modes @ rising, to_modes @ changing])

    start = np.zeros(2 * len(modes))
    start[1] = steepness / K
    times = np.linspace(0.0, 1.02 * END, 600)
    found = solve_ivp(rate, (0.0, times[-1]), start, t_eval=times, rtol=1e-8, atol=1e-10).y[: len(modes)]
    return times, found.sum(axis=0), (found.T * (-1.0) ** modes).sum(axis=1)


def measure(folder: Folder) -> Measured:
    """Return the error of the elevation over five periods, and the decay from the peaks of the kinetic energy."""
    steepness = K * _amplitude(folder)
    times, *surface = potential_flow(steepness)
    a = steepness / K
    errors, curves = [], {}
    for name, exact in zip(("crest", "trough"), surface, strict=True):
        gauge = folder.gauge(name)
        t, eta = gauge["time"], gauge["elevation"] - DEPTH
        inside = t <= END
        errors.append((eta - np.interp(t, times, exact))[inside] / a)
        curves[f"elevation, {name}, ka = {steepness:.1f}"] = (t / PERIOD, eta / a)
    energy = folder.gauge("energy")
    t, kinetic = energy["time"], energy["kinetic"]
    peaks = [kinetic[(t >= n * PERIOD / 2) & (t < (n + 1) * PERIOD / 2)].max() for n in range(10)]
    slope = np.polyfit(np.arange(10) / 2.0, np.log(peaks), 1)[0]
    viscous = 2.0 * folder.case.fluid[0].viscosity * K**2 * PERIOD
    curves["peaks of the kinetic energy"] = (np.arange(10) / 2.0 + 0.25, np.array(peaks) / peaks[0])
    return Measured(
        {ELEVATION: rms(np.concatenate(errors)), DECAY: float(1.0 - math.exp(slope / 2.0) - viscous)}, curves
    )


def _amplitude(folder: Folder) -> float:
    return next(float(f.amplitude) for f in folder.case.fluid[0].initial if hasattr(f, "amplitude"))


def _reference(steepness: float, place: int) -> Mapping[str, Curve]:
    times, *surface = potential_flow(steepness)
    return {"potential flow": (times / PERIOD, surface[place] * K / steepness)}


def _run(steepness: float, cells: int) -> Run:
    initial = (
        f"fluid.water.initial=[{{kind='standing-wave', amplitude={steepness / K!r}, wavelength=2.0}}, 'hydrostatic']"
    )
    settings = (f"spacing={DEPTH / cells!r}", "time.end=5.81", "output.frames=false", initial)
    return Run("standing-wave", cells, settings, f"ka = {steepness}")


STUDY = Study(
    number="5",
    title="Standing gravity wave, λ = 2 m, h = 1 m",
    length="h/l0",
    reference="nonlinear potential flow, solved in `standing_wave.py`; viscous decay exp(−2νk²t) (Lamb)",
    runs=tuple(_run(s, n) for s in (0.1, 0.2) for n in (12, 25, 50)),
    quick=(_run(0.1, 12), _run(0.1, 20)),
    measure=measure,
    bars=(
        Bar(ELEVATION, 0.03, series="ka = 0.1", cells=50, quick=(0.0, 0.5)),
        Bar(DECAY, 0.005, series="ka = 0.1", cells=50, quick=(-0.02, 0.06)),
        Bar(ELEVATION, 0.03, series="ka = 0.2", cells=50),
        Bar(DECAY, 0.005, series="ka = 0.2", cells=50),
    ),
    panels={
        **{
            f"elevation, {name}, ka = {s}": Panel("t / T", "η / a", reference=partial(_reference, s, place))
            for s in (0.1, 0.2)
            for place, name in enumerate(("crest", "trough"))
        },
        "peaks of the kinetic energy": Panel("t / T", "peak / first peak"),
    },
    orders=(ELEVATION, DECAY),
)
