"""Draw the time of a step over size, by device, from figures that were measured.

python benchmarks/plot_devices.py benchmarks/results/2026-11-26-devices.json docs/images/cost-on-devices.svg
"""

import argparse
import json
from pathlib import Path


def main() -> None:
    """Read the figures, a list of objects with ``device``, ``fluid`` [1] and ``seconds`` a step, and draw them."""
    import matplotlib

    matplotlib.use("Agg")
    matplotlib.rcParams["svg.hashsalt"] = "spume"
    import matplotlib.pyplot as plt

    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("figures", type=Path)
    parser.add_argument("picture", type=Path)
    asked = parser.parse_args()
    points = json.loads(asked.figures.read_text(encoding="utf-8"))
    fig, ax = plt.subplots(figsize=(7.2, 3.8), constrained_layout=True)
    colours = ("#0b3c5d", "#328cc1", "#d9822b", "#7a9e3b")
    for device, colour in zip(dict.fromkeys(p["device"] for p in points), colours, strict=False):
        mine = sorted((p["fluid"], p["seconds"]) for p in points if p["device"] == device)
        x, y = [p[0] for p in mine], [p[1] for p in mine]
        ax.loglog(x, y, "o-", color=colour, lw=1.6, ms=5)
        # A line is named where it begins, a single point beside it.
        k, offset = (0, (9, -9)) if len(mine) > 1 else (-1, (8, -3))
        ax.annotate(
            device, (x[k], y[k]), xytext=offset, textcoords="offset points", va="center", color=colour,
            fontsize=9,
        )  # fmt: skip
    ax.set(xlabel="fluid particles", ylabel="time of a step [s]", xlim=(1e5, 6e8), ylim=(0.01, 60))
    ax.grid(True, which="major", color="#e3e6ea", lw=0.8)
    for side in ("top", "right"):
        ax.spines[side].set_visible(False)
    fig.savefig(asked.picture, metadata={"Date": None})


if __name__ == "__main__":
    main()
