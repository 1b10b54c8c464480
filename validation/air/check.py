"""A slug of water between two volumes of air: the period that the gas law gives, and what the model makes of it.

    python validation/air/check.py

The slug, w = 0.2 m long, moves without gravity in a closed tube (periodic across). The larger volume of air keeps its
pressure, the smaller one, a = 0.1 m long, is a spring: small oscillations have omega^2 = gamma P_0/(rho w a). Printed
for three spacings and three pressures: the period of the second and third swing over the exact one, less one, and the
amplitude that a period loses; in 3D at the coarsest spacing. Written to results.json and figure.png.
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
CASES = [
    (2, 0.02, 101325.0), (2, 0.01, 101325.0), (2, 0.005, 101325.0), (2, 0.01, 1000.0), (2, 0.01, 1e7),
    (3, 0.02, 101325.0),
]  # fmt: skip
"""Dimensions, spacing [m], P_0 [Pa]."""


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
    simulation = case.build(threads=1)
    times, places = [], []
    while not simulation.done:
        simulation.advance()
        particles = simulation.particles
        x = particles.numpy("position")[particles.numpy("kind") == FLUID, 0].mean()
        times.append(simulation.time)
        places.append((x - AIR - SLUG / 2) / AIR)
    return np.array(times), np.array(places), period


def main() -> None:
    """Run every case."""
    import logging

    import matplotlib.pyplot as plt

    logging.getLogger("spume").setLevel(logging.ERROR)
    figure, axes = plt.subplots(figsize=(7, 3.2), layout="constrained")
    results = []
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
    figure.savefig(HERE / "figure.png", dpi=110)
    (HERE / "results.json").write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
