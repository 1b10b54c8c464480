"""Effect of the two limits of the time step: the study behind their defaults.

    python validation/settings/check.py [H/l0 of the dam break] [--threads N]

Three cases a setting: water at rest (case 1, H/l0 = 20), a standing wave (case 5, h/l0 = 20) and the dam break of
Lobovsky et al. (case 6b), with the default step. Prints a table and writes it to results.json.
"""

import json
import math
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).parent
G = 9.81

SETTINGS: list[tuple[str, str]] = [
    ("0.2", "0.5"),
    ("0.25", "0.75"),
    ("0.2", "1.0"),
    ("0.3", "1.0"),
    ("0.4", "1.0"),
    ("0.5", "1.0"),
    ("0.3", "0.5"),
    ("0.2", "0.2"),
]
"""Courant number of the relative motion, and largest way of a particle in a step [l0]."""


def run(name: str, settings: list[str]) -> dict[str, Any]:
    """Run a case without output; return figures of its motion and cost."""
    from spume.build import build
    from spume.case import load
    from spume.outputs import budgets

    simulation = build(load(name, settings), threads=1)
    state = simulation.snapshot()
    fluid = int(state.fluid.sum())
    iterations, density, times, energy = [], [], [], []
    begin = time.perf_counter()
    while not simulation.done:
        simulation.advance()
        iterations.append(simulation.statistics["iterations"])
        if simulation.step_index % 10 == 0:
            state = simulation.snapshot()
            f = state.fluid
            inner = f & (state["surface_share"] == 0.0)
            density.append(float(np.mean(np.abs(state["number_density"][inner] - state.n0)) / state.n0))
            times.append(simulation.time)
            energy.append(budgets.kinetic_energy(state))
    state = simulation.snapshot()
    y, p = state["position"][state.fluid], state["pressure"][state.fluid]
    return {
        "steps": simulation.step_index,
        "iterations": float(np.mean(iterations)),
        "density": float(np.mean(density)),
        "seconds": time.perf_counter() - begin,
        "fluid": fluid,
        "times": np.array(times),
        "kinetic": np.array(energy),
        "position": y,
        "pressure": p,
    }


def at_rest(settings: list[str]) -> dict[str, float]:
    """Return the pressure error of water at rest, as a share of rho g H."""
    found = run("hydrostatic", ["spacing=0.05", "time.end=6.0", *settings])
    y, p = found["position"][:, 1], found["pressure"]
    surface = np.sort(y)[-10:].mean() + 0.025
    error = float(np.sqrt(np.mean((p - 1000.0 * G * (surface - y)) ** 2)) / (1000.0 * G))
    return {"error": error, "kinetic": float(found["kinetic"][-20:].mean()), "iterations": found["iterations"]}


def wave(settings: list[str]) -> dict[str, float]:
    """Return what a standing wave loses of its energy in a period (peaks of the kinetic energy, first to last)."""
    found = run("standing-wave", ["spacing=0.05", *settings])
    t, k = found["times"], found["kinetic"]
    period = 5.8 / 5
    peaks = [k[(t >= n * period / 2) & (t < (n + 1) * period / 2)].max() for n in range(10)]
    lost = 1.0 - (peaks[-1] / peaks[1]) ** (2.0 / 8.0)
    return {"lost": float(lost), "iterations": found["iterations"]}


def dam_break(cells: int, settings: list[str]) -> dict[str, float]:
    """Return errors of pressures and levels, density error, iterations and cost of the dam break."""
    from spume.case import load

    case = load("dam-break", [f"spacing={0.3 / cells!r}", "output.pictures=false", "output.animation=none", *settings])
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "run"
        case.run(folder, threads=1)
        summary = json.loads((folder / "summary.json").read_text())
    found = {entry["gauge"]: entry for entry in summary["comparison"]}
    motion = run("dam-break", [f"spacing={0.3 / cells!r}", *settings])
    return {
        "pressure rms": float(np.mean([found[f"pressure-{k}"]["rms"] for k in range(1, 5)])),
        "level rms": float(np.mean([found[f"level-{k}"]["rms"] for k in range(1, 5)])),
        "peak": found["pressure-2"]["peak"],
        "density": motion["density"],
        "drift": summary["volume_drift"],
        "collisions": summary["counts"].get("collisions", math.nan),
        "iterations": motion["iterations"],
        "steps": motion["steps"],
        "seconds": motion["seconds"],
    }


def main() -> None:
    """Run every setting; print and save the table."""
    cells = int(sys.argv[1]) if len(sys.argv) > 1 else 40
    rows = []
    print(
        "Courant travel | at rest: rms p, kinetic energy, iterations | wave: energy lost a period | dam break: rms p,"
    )
    print("  rms p, rms levels, peak, |n - n0|/n0, volume drift, collisions, iterations, steps, seconds", flush=True)
    for courant, travel in SETTINGS:
        settings = [f"time.courant={courant}", f"time.travel={travel}"]
        row: dict[str, Any] = {"courant": float(courant), "travel": float(travel)}
        row |= {"rest": at_rest(settings), "wave": wave(settings), "dam break": dam_break(cells, settings)}
        rows.append(row)
        r, w, d = row["rest"], row["wave"], row["dam break"]
        print(
            f"{courant:>7} {travel:>6} | {100 * r['error']:6.3f} % {r['kinetic']:.1e} {r['iterations']:4.1f} | "
            f"{100 * w['lost']:6.2f} % | "
            f"{d['pressure rms']:.3f} {100 * d['level rms']:.2f} % {d['peak']:.2f} {100 * d['density']:.2f} % "
            f"{100 * d['drift']:.2f} % {d['collisions']:.0f} {d['iterations']:.1f} {d['steps']} {d['seconds']:.0f}",
            flush=True,
        )
        (HERE / "results.json").write_text(json.dumps({"H/l0": cells, "rows": rows}, indent=2, default=float) + "\n")


if __name__ == "__main__":
    main()
