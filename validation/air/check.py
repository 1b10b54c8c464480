"""Enclosed air as a spring: the periods that the gas law gives, and what the model makes of them.

    python validation/air/check.py

A slug of water, w = 0.2 m long, moves without gravity in a closed tube (periodic across). The larger volume of air
keeps its pressure, the smaller one, a = 0.1 m long, is a spring: small oscillations have omega^2 =
gamma P_0/(rho w a). Printed for three spacings and three pressures: the period of the second and third swing over the
exact one, less one, and the amplitude that a period loses; in 3D at the coarsest spacing.

Two columns of equal width under gravity are joined at their feet. One is open, the other is closed by a lid 0.3 m above
the mean level. The water swings with omega^2 = 2 g/L without air and [2 g + gamma P/(rho h)]/L with it, P and h being
pressure and height of the air where the water would rest and L some length of the water, so that the ratio is
1 + gamma P/(2 rho g h) (small swings). Printed is the ratio found.
Written to results.json and figure.png.
"""

import json
import math
from pathlib import Path

import numpy as np

import spume
from spume.particles import FLUID

HERE = Path(__file__).parent
AIR, SLUG, GAMMA, STRAIN = 0.1, 0.2, 1.4, 0.02
"""Lengths [m], ratio of the heat capacities, largest change of the air's length over it."""
CHAMBER, MORE = 0.3, 0.02
"""Height of the lid above the mean level, and of the water under it at first [m]."""
CASES = [
    (2, 0.02, 101325.0), (2, 0.01, 101325.0), (2, 0.005, 101325.0), (2, 0.01, 1000.0), (2, 0.01, 1e7),
    (3, 0.02, 101325.0),
]  # fmt: skip
"""Dimensions, spacing [m], P_0 [Pa]."""


def mean_place(case: spume.Case) -> tuple[np.ndarray, np.ndarray]:
    """Run a case; return the times [s] of its steps, and where the water is along x in the mean [m]."""
    simulation = case.build(threads=1)
    times, places = [], []
    while not simulation.done:
        simulation.advance()
        particles = simulation.particles
        times.append(simulation.time)
        places.append(particles.numpy("position")[particles.numpy("kind") == FLUID, 0].mean())
    return np.array(times), np.array(places)


def run(d: int, l0: float, pressure: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Return times, displacements of the slug over a, and the exact period [s]."""
    height = 12 * l0
    omega = math.sqrt(GAMMA * pressure / (1000.0 * SLUG * AIR))
    period = 2.0 * math.pi / omega
    across = [0.0] * (d - 1), [height] * (d - 1)

    def box(first: float, last: float) -> spume.Box:
        return spume.Box(lower=[first, *across[0]], upper=[last, *across[1]])

    speed = [-STRAIN * AIR * omega, *across[0]]
    case = spume.Case(
        dimension=d, spacing=l0, time=spume.Time(end=3.1 * period),
        domain=spume.Domain(
            gravity=[0.0] * d, lower=[-0.1, *across[0]], upper=[0.7, *across[1]], periodic=["y", "z"][: d - 1]
        ),
        fluid=[
            spume.Fluid(name="water", shape=box(AIR, AIR + SLUG), initial={"kind": "uniform", "value": speed}),
        ],
        body=[
            spume.Wall(name="left", shape=box(-4 * l0, 0.0)),
            spume.Wall(name="right", shape=box(0.6, 0.6 + 4 * l0)),
        ],
        step={"name": "project-in-place", "air": {"name": "adiabatic", "pressure": pressure, "exponent": GAMMA}},
    )  # fmt: skip
    t, x = mean_place(case)
    return t, (x - AIR - SLUG / 2) / AIR, period


def joined_columns(l0: float, air: dict[str, object] | str) -> float:
    """Return the angular frequency [1/s] of two joined columns, one of them under a lid."""
    from scipy.optimize import curve_fit

    def box(lower: tuple[float, float], upper: tuple[float, float]) -> spume.Box:
        return spume.Box(lower=list(lower), upper=list(upper))

    level = 0.6
    water = (box((0.0, 0.0), (0.2, level + MORE)), box((0.28, 0.0), (0.48, level - MORE)), box((0.2, 0.0), (0.28, 0.2)))
    walls = {
        "tank": spume.Tank(lower=[0.0, 0.0], upper=[0.48, 1.0], open=["top"]),
        "divider": box((0.2, 0.2), (0.28, 1.0)),
        "lid": box((-0.08, level + CHAMBER), (0.28, level + CHAMBER + 0.08)),
    }
    case = spume.Case(
        spacing=l0, time=spume.Time(end=2.5),
        fluid=[spume.Fluid(name=f"water{k}", shape=shape) for k, shape in enumerate(water)],
        body=[spume.Wall(name=name, shape=shape, slip="free-slip") for name, shape in walls.items()],
        step={"name": "project-in-place", "air": air},
    )  # fmt: skip
    t, x = mean_place(case)

    def swing(t: np.ndarray, mean: float, a: float, b: float, omega: float, decay: float) -> np.ndarray:
        return mean + np.exp(-decay * t) * (a * np.cos(omega * t) + b * np.sin(omega * t))

    fits = []
    for guess in (4.0, 6.0, 9.0, 13.0):
        found, _ = curve_fit(swing, t, x, p0=[x.mean(), 0.001, 0.0, guess, 0.1], maxfev=20000)
        fits.append((float(np.square(swing(t, *found) - x).sum()), abs(float(found[3]))))
    return min(fits)[1]


def stiffening(pressure: float) -> float:
    """Return omega^2 with air over that without, about the level at which the water would rest."""
    from scipy.optimize import brentq

    def over(y: float) -> float:
        return pressure * (((CHAMBER - MORE) / (CHAMBER - y)) ** GAMMA - 1.0)

    y = brentq(lambda y: over(y) + 2.0 * 9810.0 * y, -MORE, MORE)
    return float(1.0 + GAMMA * (pressure + over(y)) / (2.0 * 9810.0 * (CHAMBER - y)))


def main() -> None:
    """Run every case."""
    import logging

    import matplotlib.pyplot as plt

    logging.getLogger("spume").setLevel(logging.ERROR)
    figure, axes = plt.subplots(figsize=(7, 3.2), layout="constrained")
    results: list[dict[str, float]] = []
    for d, l0, pressure in CASES:
        t, x, period = run(d, l0, pressure)
        crossing = np.flatnonzero(x[:-1] * x[1:] < 0)
        instants = t[crossing] - x[crossing] * (t[crossing + 1] - t[crossing]) / (x[crossing + 1] - x[crossing])
        found = (instants[5] - instants[1]) / 2.0
        swings = [np.abs(x[(t > k * period) & (t < (k + 1) * period)]).max() for k in range(3)]
        row = {
            "d": d, "l0": l0, "pressure": pressure, "period error": found / period - 1.0,
            "amplitude lost a period": 1.0 - math.sqrt(swings[2] / swings[0]), "steps a period": len(t) / 3.1,
        }  # fmt: skip
        results.append(row)
        print(
            f"{d}D, a/l0 = {AIR / l0:.0f}, P_0 = {pressure:8.6g} Pa: period {row['period error']:+.2%}, amplitude lost "
            f"a period {row['amplitude lost a period']:+.2%}, {row['steps a period']:.0f} steps a period",
            flush=True,
        )
        if d == 2 and pressure > 1e5 and pressure < 2e5:
            axes.plot(t / period, x, ".-", lw=0.8, ms=4, label=f"a/l0 = {AIR / l0:.0f}")
    exact = np.linspace(0.0, 3.1, 400)
    axes.plot(exact, -STRAIN * np.sin(2.0 * math.pi * exact), "k", lw=0.8, label="small oscillation")
    axes.set(xlabel="t / T", ylabel="displacement / a", title="A slug of water on a spring of air", ylim=(-0.03, 0.023))
    axes.legend(ncols=4, loc="lower center", frameon=False)
    for l0 in (0.02, 0.01):
        alone = joined_columns(l0, "none")
        for pressure in (5000.0, 20000.0):
            found = (joined_columns(l0, {"name": "adiabatic", "pressure": pressure}) / alone) ** 2
            exact = stiffening(pressure)
            results.append({"lid/l0": CHAMBER / l0, "pressure": pressure, "ratio": found, "exact": exact})
            print(
                f"joined columns, lid at {CHAMBER / l0:.0f} l0, P_0 = {pressure:g} Pa: omega^2 {found:.3f} times that "
                f"without air, exact {exact:.3f}, {found / exact - 1.0:+.1%}",
                flush=True,
            )
    figure.savefig(HERE / "figure.png", dpi=110)
    (HERE / "results.json").write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
