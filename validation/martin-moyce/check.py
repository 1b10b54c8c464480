"""Case 6a: front of a collapsing column, Martin & Moyce (1952), at a/l0 = 12, 25 and 50.

python validation/martin-moyce/check.py [a/l0 …]
"""

import math
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

G, A = 9.81, 0.05715


def front(cells: int, folder: Path) -> np.ndarray:
    """Return t sqrt(2g/a) and x/a of the front at a/l0 = cells."""
    settings = [f"spacing={A / cells!r}", "time.end=0.35", "output.pictures=false", "output.animation=none"]
    load("dam-break-martin-moyce", settings).run(folder)
    table = np.genfromtxt(folder / "gauges" / "front.csv", delimiter=",", skip_header=1, comments="#")
    return np.column_stack([table[:, 0] * math.sqrt(2 * G / A), table[:, 1] / A])


def main() -> None:
    """Run the resolutions, print and save what was reached."""
    sizes = [int(a) for a in sys.argv[1:]] or [12, 25, 50]
    reference = Path(__file__).parents[2] / "src/spume/cases/dam-break-martin-moyce/front.csv"
    measured = np.genfromtxt(reference, delimiter=",", comments="#", skip_header=0)
    measured = measured[np.isfinite(measured).all(axis=1)]
    notes: dict[str, object] = {}
    curves = {}
    with tempfile.TemporaryDirectory() as scratch:
        for n in sizes:
            curves[n] = front(n, Path(scratch) / f"a-{n}")
    for n, curve in curves.items():
        best = (math.inf, 0.0, 0.0)
        points = measured[measured[:, 0] < curve[-1, 0] - 0.5]
        for shift in np.linspace(-0.5, 0.5, 101):
            error = np.abs(np.interp(points[:, 0] + shift, curve[:, 0], curve[:, 1]) / points[:, 1] - 1.0)
            best = min(best, (float(error.mean()), float(error.max()), float(shift)))
        notes[f"a/l0 = {n}"] = {"mean error": best[0], "largest error": best[1], "shift of origin": best[2]}
    last = notes[f"a/l0 = {sizes[-1]}"]
    title = f"Case 6a, front of Martin & Moyce, a/l0 = {sizes[-1]}"
    bars = [
        Bar("mean error of the front", 0.05, last["mean error"]),
        Bar("largest error", 0.12, last["largest error"]),
    ]
    show(title, bars, notes)
    save(HERE / "results.json", title, bars, notes)
    figure, axis = plt.subplots(figsize=(6, 4), layout="constrained")
    for n, curve in curves.items():
        axis.plot(curve[:, 0], curve[:, 1], label=f"a/l0 = {n}")
    axis.plot(
        measured[:, 0] + last["shift of origin"],
        measured[:, 1],
        "ko",
        ms=4,
        label="measured (origin shifted)",
    )
    axis.set(xlabel="t √(2g/a)", ylabel="x / a", xlim=(0, curve[-1, 0]), title="front on the floor")
    axis.legend(frameon=False)
    figure.savefig(HERE / "figure.png", dpi=110)


if __name__ == "__main__":
    main()
