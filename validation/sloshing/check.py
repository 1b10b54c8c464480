"""Case 7a: sloshing with lateral impact, SPHERIC test 10: the first four peaks, and the time between them.

    python validation/sloshing/check.py [depth/l0 …]
    python validation/sloshing/check.py --folder RUN   # judge a run that is there already

The peaks are compared with mean and standard deviation of 100 repetitions of the experiment (Souto-Iglesias et
al. 2011; the first agrees with Botia-Vera et al. 2010). A peak is the largest value of the left sensor in an
interval of 0.8 s around the measured impact, as computed at every step: nothing is smoothed.
"""

import csv
import json
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

DEPTH = 0.093
MEASURED = ((3710.0, 730.0), (4820.0, 1500.0), (4690.0, 1710.0), (4640.0, 1320.0))
"""Mean and standard deviation of the first four peaks [Pa]."""
IMPACTS = (2.375, 4.067, 5.672, 7.303)
"""Times of the peaks of the one run of the experiment whose series is published [s]."""


def run(cells: int, folder: Path) -> None:
    """Run the case at depth/l0 = cells."""
    settings = [f"spacing={DEPTH / cells!r}", "output.pictures=false", "output.animation=none", "output.frames=false"]
    load("sloshing", settings).run(folder, threads=1)


def series(folder: Path, gauge: str) -> np.ndarray:
    """Return time and value of a gauge of a run, shape (n, 2)."""
    with (folder / "gauges" / f"{gauge}.csv").open(encoding="utf-8") as file:
        return np.array([[float(x) for x in line[:2]] for line in list(csv.reader(file))[1:]])


def peaks(left: np.ndarray) -> tuple[list[float], list[float]]:
    """Return the four peaks [Pa] and their times [s]."""
    heights, times = [], []
    for instant in IMPACTS:
        near = left[np.abs(left[:, 0] - instant) < 0.4]
        heights.append(float(near[:, 1].max()))
        times.append(float(near[near[:, 1].argmax(), 0]))
    return heights, times


def lasting(left: np.ndarray, instant: float, duration: float = 0.01) -> float:
    """Return the largest mean over a duration [s] around an impact [Pa]: what the largest single value hides."""
    t = np.arange(instant - 0.4, instant + 0.4, 0.0005)
    p = np.interp(t, *left.T)
    n = round(duration / 0.0005)
    return float(np.convolve(p, np.ones(n) / n, "valid").max())


def main() -> None:
    """Run the resolutions, print and save what was reached."""
    folders: dict[int, Path] = {}
    with tempfile.TemporaryDirectory() as scratch:
        if sys.argv[1:2] == ["--folder"]:
            given = Path(sys.argv[2])
            folders[round(DEPTH / json.loads((given / "summary.json").read_text())["spacing"])] = given
        for n in [] if folders else [int(a) for a in sys.argv[1:]] or [15]:
            folders[n] = Path(scratch) / f"depth-{n}"
            run(n, folders[n])
        report(folders)


def report(folders: dict[int, Path]) -> None:
    """Print and save bars, notes and the figure."""
    bars: list[Bar] = []
    notes: dict[str, object] = {"peaks of the published single run [Pa]": [3683, 3890, 2663, 7148]}
    figure, axis = plt.subplots(figsize=(9, 4), layout="constrained")
    for n, folder in folders.items():
        left, summary = series(folder, "left"), json.loads((folder / "summary.json").read_text())
        heights, times = peaks(left)
        volume = series(folder, "volume")
        notes[f"depth/l0 = {n}"] = {
            "peaks [Pa]": [round(p) for p in heights],
            "peaks of the mean over 10 ms [Pa]": [round(lasting(left, t)) for t in IMPACTS],
            "times [s]": [round(t, 3) for t in times],
            "steps": summary["steps"],
            "us per fluid particle and step": summary["us_per_fluid_particle_step"],
            "volume, largest and last / first - 1": [
                round(float(v / volume[1, 1] - 1.0), 4) for v in (volume[1:, 1].max(), volume[-1, 1])
            ],
            "counts": summary["counts"],
        }
        axis.plot(*left.T, lw=0.8, label=f"depth/l0 = {n}")
        if n == list(folders)[-1]:
            for k, (p, (mean, deviation)) in enumerate(zip(heights, MEASURED, strict=True)):
                width = deviation if k == 0 else 2 * deviation
                bars.append(Bar(f"peak {k + 1} [Pa]", (mean - width, mean + width), p))
            period, measured = (times[-1] - times[0]) / 3, (IMPACTS[-1] - IMPACTS[0]) / 3
            bars.append(Bar("|period / measured - 1|", 0.02, abs(period / measured - 1.0)))
            bars.append(Bar("particles lost", 0, summary["counts"]["removed"]))
    for (mean, deviation), t in zip(MEASURED, IMPACTS, strict=True):
        axis.errorbar(t, mean, 2 * deviation, color="k", capsize=4, marker="o", lw=1)
    axis.set(xlabel="t [s]", ylabel="p [Pa]", ylim=(-500, 12000), title="left wall, 93 mm above the floor")
    axis.legend(frameon=False)
    title = f"Case 7a, SPHERIC test 10, lateral impact, 2D, depth/l0 = {list(folders)[-1]}"
    show(title, bars, notes)
    save(HERE / "results.json", title, bars, notes)
    figure.savefig(HERE / "figure.png", dpi=110)


if __name__ == "__main__":
    main()
