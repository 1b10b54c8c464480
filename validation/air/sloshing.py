"""The first two impacts of case 7a with and without enclosed air, beside the measured pressure.

    SPUME_REFERENCE_DATA=... python validation/air/sloshing.py [DEPTH/l0 ...]

Runs `sloshing` to the second impact for each resolution (default 15 and 31) with `step.air` none and adiabatic, and
prints the largest pressure of the left sensor and the largest mean over 10 ms at both impacts. The measured series is
drawn where it is found. Written to sloshing.json and sloshing.png.
"""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np

import spume
from spume.validation.cases.sloshing import DEPTH, IMPACTS, lasting
from spume.validation.folder import Folder
from spume.validation.study import reference_file, table

HERE = Path(__file__).parent
FIRST, END = IMPACTS[:2], 4.5
MEASURED = "07_sloshing/spheric10_lateral_water_pressure.csv"


def main(cells: list[int]) -> None:
    """Run, print and draw."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(len(cells), 2, figsize=(10, 2.8 * len(cells)), layout="constrained", squeeze=False)
    results = []
    with tempfile.TemporaryDirectory() as folder:
        for row, n in enumerate(cells):
            for air in ("none", "adiabatic"):
                out = Path(folder) / f"{n}-{air}"
                keys = [f"spacing={DEPTH / n!r}", f"step.air={air}", f"time.end={END}", "output.frames=false"]
                spume.load("sloshing", keys).run(out, threads=1)
                gauge = Folder(out).gauge("left")
                t, p = gauge["time"], gauge["pressure"]
                values = [(float(p[np.abs(t - instant) < 0.4].max()), lasting(t, p, instant)) for instant in FIRST]
                results.append({"depth/l0": n, "air": air, "largest, mean over 10 ms [Pa]": values})
                text = ", ".join(f"{peak:.0f} ({mean:.0f})" for peak, mean in values)
                print(f"depth/l0 = {n}, air {air:9}: largest (over 10 ms) {text} Pa", flush=True)
                for ax, instant in zip(axes[row], FIRST, strict=True):
                    near = np.abs(t - instant) < 0.12
                    ax.plot(t[near], p[near] / 1e3, lw=0.9, label=f"air: {air}")
            path = reference_file(MEASURED)
            for ax, instant in zip(axes[row], FIRST, strict=True):
                if path is not None:
                    time, measured = table(path).T
                    near = np.abs(time - instant) < 0.12
                    ax.plot(time[near], measured[near] / 1e3, "k", lw=0.9, label="one experiment")
                ax.set(xlabel="t [s]", ylabel="p [kPa]", title=f"depth / l0 = {n}", xlim=(instant - 0.1, instant + 0.1))
        axes[0, 0].legend(loc="upper left")
    figure.savefig(HERE / "sloshing.png", dpi=110)
    (HERE / "sloshing.json").write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main([int(text) for text in sys.argv[1:]] or [15, 31])
