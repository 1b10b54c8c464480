"""Case 6b: the dam break of Lobovsky et al. (2014): pressures and levels.

    python validation/dam-break/check.py [2|3] [H/l0 …]

The bars use the tables that come with the case. With SPUME_REFERENCE_DATA naming the folder of the full
series, the pressures are compared with those as well.
"""

import json
import math
import os
import sys
import tempfile
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

from report import Bar, save, show

from spume.case import load

G, H, RHO = 9.81, 0.3, 1000.0
SENSORS = ("pressure-1", "pressure-2", "pressure-3", "pressure-4")
LEVELS = ("level-1", "level-2", "level-3", "level-4")


def run(dimension: int, cells: int, folder: Path) -> dict[str, object]:
    """Run the case at H/l0 = cells; return its summary and its pressure series."""
    name = "dam-break" if dimension == 2 else "dam-break-3d"
    settings = [
        f"spacing={H / cells!r}",
        "time.end=1.0",
        "time.courant=0.2",
        "output.pictures=false",
        "output.animation=none",
    ]
    case = load(name, settings)
    case.run(folder)
    summary = json.loads((folder / "summary.json").read_text())
    series = {
        s: np.genfromtxt(folder / "gauges" / f"{s}.csv", delimiter=",", skip_header=1, comments="#") for s in SENSORS
    }
    return {"summary": summary, "series": series}


def measured(sensor: int) -> np.ndarray | None:
    """Return the full measured series of a sensor (t sqrt(g/H), p / rho g H), if its folder is named."""
    folder = os.environ.get("SPUME_REFERENCE_DATA")
    if not folder:
        return None
    file = Path(folder) / "06_dambreak" / f"lobovsky2014_H300_sensor{sensor}_pressure.csv"
    return np.genfromtxt(file, delimiter=",", skip_header=1)


def published() -> dict[str, float]:
    """Return the rms of De Courcy et al. (2024, H/dx = 400) against the measured pressures, t* = 2.45 … 5.3."""
    found = {}
    for k, sensor in enumerate(SENSORS, start=1):
        full = measured(k)
        if full is not None:
            file = Path(os.environ["SPUME_REFERENCE_DATA"]) / "06_dambreak" / f"decourcy2024_numerical_P{k}.csv"
            computed = np.genfromtxt(file, delimiter=",", skip_header=1)
            t = np.linspace(2.45, 5.3, 2000)
            difference = np.interp(t, *computed.T) - np.interp(t, *full.T)
            found[sensor] = round(float(np.sqrt(np.mean(difference**2))), 3)
    return found


def main() -> None:
    """Run the resolutions, print and save what was reached."""
    dimension = int(sys.argv[1]) if len(sys.argv) > 1 else 2
    sizes = [int(a) for a in sys.argv[2:]] or ([30, 60, 100] if dimension == 2 else [30])
    results = {}
    with tempfile.TemporaryDirectory() as scratch:
        for n in sizes:
            results[n] = run(dimension, n, Path(scratch) / f"H-{n}")
    title = f"Case 6b, dam break of Lobovsky et al. {dimension}D, H/l0 = {sizes[-1]}"
    scale = math.sqrt(G / H)
    notes: dict[str, object] = {"rms of De Courcy et al. (2024)": published()}
    bars: list[Bar] = []
    for n, result in results.items():
        summary = result["summary"]
        found = {entry["gauge"]: entry for entry in summary["comparison"]}
        notes[f"H/l0 = {n}"] = {
            **{f"rms {k}": round(found[k]["rms"], 4) for k in (*SENSORS, *LEVELS) if k in found and found[k]["rms"]},
            "peak pressure-1": found["pressure-1"]["peak"],
            "peak pressure-2": found["pressure-2"]["peak"],
            "arrival pressure-2": found["pressure-2"]["arrival"],
            "shift": found["pressure-2"]["shift"],
            "steps": summary["steps"],
            "us per fluid particle and step": summary["us_per_fluid_particle_step"],
            "iterations": summary["pressure_iterations_mean"],
            "volume drift": summary["volume_drift"],
            "counts": summary["counts"],
        }
        if n == sizes[-1]:
            bars = [Bar("peak at z = 15 mm / rho g H", (1.77, 2.03), found["pressure-2"]["peak"])]
            bars += [Bar(f"rms {k} / rho g H, t* = 2.45…5.3", 0.15, found[k]["rms"]) for k in SENSORS]
            bars += [Bar(f"rms {k} / H", 0.04, found[k]["rms"]) for k in LEVELS if k in found]
    show(title, bars, notes)
    save(HERE / f"results-{dimension}d.json", title, bars, notes)
    figure, axes = plt.subplots(4, 1, figsize=(8, 10), layout="constrained", sharex=True)
    for k, (axis, sensor) in enumerate(zip(axes, SENSORS, strict=True)):
        for n, result in results.items():
            t, p = result["series"][sensor][:, 0] * scale, result["series"][sensor][:, 1] / (RHO * G * H)
            axis.plot(t, p, lw=0.8, label=f"H/l0 = {n}")
        full = measured(k + 1)
        if full is not None:
            axis.plot(full[:, 0], full[:, 1], color="k", lw=0.8, label="measured")
        axis.set(ylabel="p / ρgH", title=sensor, xlim=(2.0, 5.7), ylim=(-0.5, 4.0 if k == 0 else 2.5))
    axes[0].legend(frameon=False)
    axes[-1].set_xlabel("t √(g/H)")
    figure.savefig(HERE / f"figure-{dimension}d.png", dpi=110)


if __name__ == "__main__":
    main()
