"""Case 1: water at rest in a tank, from a lattice disturbed by 10 % of l0.

python validation/hydrostatic/check.py [2|3] [H/l0 ...]
"""

import math
import sys
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

from report import Bar, save, show

from spume.build import build
from spume.case import load

G, H, RHO = 9.81, 1.0, 1000.0


def run(dimension: int, cells: int) -> dict[str, np.ndarray | float]:
    """Run the tank at H/l0 = cells; return the series and the means over t sqrt(g/H) = 10 … 50."""
    case = load("hydrostatic" if dimension == 2 else "hydrostatic-3d", [f"spacing={H / cells!r}"])
    simulation = build(case)
    l0 = case.spacing
    area = 0.5 if dimension == 2 else 0.25
    tops = round(area / l0 ** (dimension - 1))
    fluid_at_start = int(simulation.snapshot().fluid.sum())
    series: list[tuple[float, ...]] = []
    iterations = []
    while not simulation.done:
        simulation.advance()
        iterations.append(simulation.statistics["iterations"])
        t = simulation.time * math.sqrt(G / H)
        if series and t - series[-1][0] < 0.2:
            continue
        state = simulation.snapshot()
        f = state.fluid
        y, p, u = state["position"][f, -1], state["pressure"][f], state["velocity"][f]
        surface = np.sort(y)[-tops:].mean() + l0 / 2
        error = np.sqrt(np.mean((p - RHO * G * (surface - y)) ** 2)) / (RHO * G * H)
        kinetic = 0.5 * RHO * l0**dimension * (u**2).sum() / (RHO * G * H**2 * area)
        inner = state["surface_share"][f] == 0.0
        volume = np.mean(state.n0 / state["number_density"][f][inner])
        series.append((t, error, kinetic, volume, f.sum(), surface))
    table = np.array(series)
    late = table[:, 0] >= 10.0
    return {
        "series": table,
        "rms": float(np.sqrt(np.mean(table[late, 1] ** 2))),
        "kinetic": float(table[late, 2].max()),
        "drift": float(np.abs(table[late, 3] / table[late, 3][0] - 1.0).max()),
        "lost": float(fluid_at_start - table[-1, 4]),
        "iterations": float(np.mean(iterations)),
        "level": float(table[late, 5].mean()),
    }


def main() -> None:
    """Run three resolutions, print and save what was reached."""
    dimension = int(sys.argv[1]) if len(sys.argv) > 1 else 2
    sizes = [int(a) for a in sys.argv[2:]] or ([10, 20, 40] if dimension == 2 else [10, 20])
    results = {n: run(dimension, n) for n in sizes}
    finest = results[sizes[-1]]
    order = math.log(results[sizes[0]]["rms"] / finest["rms"]) / math.log(sizes[-1] / sizes[0])
    title = f"Case 1, hydrostatic tank {dimension}D, H/l0 = {sizes[-1]}"
    bars = [
        Bar("rms(p - rho g (H-y)) / rho g H, t* = 10…50", 0.005, finest["rms"]),
        Bar("largest kinetic energy / rho g H^2 area", 1e-6, finest["kinetic"]),
        Bar("volume drift (interior n0/n)", 1e-3, finest["drift"]),
        Bar("order of convergence of the rms (at least)", (1.0, math.inf), order),
        Bar("particles lost", 0, finest["lost"]),
    ]
    notes = {f"H/l0 = {n}": {k: v for k, v in r.items() if k != "series"} for n, r in results.items()}
    show(title, bars, notes)
    save(HERE / f"results-{dimension}d.json", title, bars, notes)
    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 3.6), layout="constrained")
    for n, r in results.items():
        left.semilogy(r["series"][:, 0], r["series"][:, 1], label=f"H/l0 = {n}")
        right.semilogy(r["series"][:, 0], np.maximum(r["series"][:, 2], 1e-12), label=f"H/l0 = {n}")
    left.axhline(0.005, color="0.4", ls="--", lw=1)
    right.axhline(1e-6, color="0.4", ls="--", lw=1)
    left.set(xlabel="t √(g/H)", ylabel="rms pressure error / ρgH", title="pressure")
    right.set(xlabel="t √(g/H)", ylabel="kinetic energy / ρgH² area", title="kinetic energy")
    left.legend(frameon=False)
    figure.savefig(HERE / f"figure-{dimension}d.png", dpi=110)


if __name__ == "__main__":
    main()
