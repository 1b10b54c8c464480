"""Iterations of the pressure solver over the size of the system: states of the dam break, generated systems.

    python benchmarks/iteration_counts.py [--spacings-2d 0.008 …] [--spacings-3d 0.02 …] [--times 0.02 0.42 0.7]
        [--sizes 1e4 1e5 1e6] [--repeats 3] [--json FILE] [--figure FILE] [--from FILE …]

From a zero start to a relative residual of 1e-6. The dam break runs with its own settings; at each instant the matrix
and right side of the last step are solved once more, from zero, and the pressure is put back. What a solve costs, its
set-up included, is given as so many products of the matrix with a vector. With ``--from``, results are judged and drawn
that were found before.
"""

import argparse
import json
from pathlib import Path
from typing import Any

from pressure_systems import ARRANGEMENTS, assembled
from solver_scaling import HEAD, TOLERANCE, line, measured

from spume import kernels
from spume.build import build
from spume.case import load

CASES = {2: "dam-break", 3: "dam-break-3d"}
INSTANTS = ("column", "impact", "splash")
MUST, GOAL, SPREAD = 20, 12, 0.25
"""Most iterations, and how far the count may be from its mean over all sizes of one kind of system."""


def computed(d: int, spacing: float, times: list[float], repeats: int) -> list[dict[str, Any]]:
    """Run the dam break; return what solving from zero takes at each time [s]."""
    simulation = build(load(CASES[d], [f"spacing={spacing!r}"]), threads=kernels.runtime().threads)
    found = []
    for time, name in zip(times, INSTANTS, strict=True):
        while simulation.time < time:
            simulation.advance()
        particles, system = simulation.domain.particles, simulation.domain.system
        kept = particles.numpy(system.solution)
        found.append(measured(f"dam break, {name}", particles, system, repeats))
        found[-1] |= {"computed": True, "spacing": spacing, "time": simulation.time}
        particles.set(system.solution, kept)
        print(line(found[-1]), flush=True)
    return found


def generated(d: int, size: float, repeats: int) -> list[dict[str, Any]]:
    """Return what solving from zero takes on the arrangements of the generator with about ``size`` rows."""
    found = []
    for name in ARRANGEMENTS:
        found.append(measured(name, *assembled(name, int(size), d), repeats) | {"computed": False})
        print(line(found[-1]), flush=True)
    return found


def verdict(results: list[dict[str, Any]]) -> list[str]:
    """Return what the counts say of the bars."""
    lines = []
    for d in (2, 3):
        mine = [r for r in results if r["dimension"] == d]
        if not mine:
            continue
        most = max(mine, key=lambda r: r["iterations"])
        within = sum(r["iterations"] <= GOAL for r in mine)
        lines.append(
            f"{d}D: at most {most['iterations']} iterations ({most['arrangement']}, {most['rows']:,} rows), must "
            f"{MUST}: "
            f"{'reached' if most['iterations'] <= MUST else 'missed'}; goal {GOAL} reached by {within} of {len(mine)}"
        )
        for name in dict.fromkeys(r["arrangement"] for r in mine):
            counts = [(r["rows"], r["iterations"]) for r in mine if r["arrangement"] == name and r["rows"] >= 8000]
            if len(counts) > 1:
                mean = sum(c for _, c in counts) / len(counts)
                off = max(abs(c / mean - 1) for _, c in counts)
                lines.append(
                    f"  {name}: {min(c for _, c in counts)} to {max(c for _, c in counts)} from {min(counts)[0]:,} to "
                    f"{max(counts)[0]:,} rows, within {100 * off:.0f} %, bar {100 * SPREAD:.0f} %: "
                    f"{'reached' if off <= SPREAD else 'missed'}"
                )
    return lines


def figure(results: list[dict[str, Any]], path: Path) -> None:
    """Draw iterations over rows."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    fig, axes = plt.subplots(1, 2, figsize=(9, 3.8), sharey=True, constrained_layout=True)
    names = list(dict.fromkeys(r["arrangement"] for r in results))
    for ax, d in zip(axes, (2, 3), strict=True):
        for index, name in enumerate(names):
            mine = sorted(
                (r for r in results if (r["dimension"], r["arrangement"]) == (d, name)), key=lambda r: r["rows"]
            )
            ax.plot(
                [r["rows"] for r in mine], [r["iterations"] for r in mine], marker="osD^v<>P"[index % 8], markersize=5,
                color=plt.get_cmap("viridis")(index / len(names)), label=name,
                linestyle="-" if mine and mine[0]["computed"] else "--",
            )  # fmt: skip
        ax.axhline(MUST, color="0.3", linewidth=0.8)
        ax.axhline(GOAL, color="0.3", linewidth=0.8, linestyle=":")
        ax.set(xscale="log", xlabel="rows with an equation", ylim=(0, 24), title=f"{d}D")
        ax.grid(alpha=0.3)
        ax.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylabel(f"iterations from zero to {TOLERANCE:g}")
    axes[0].text(axes[0].get_xlim()[0], MUST + 0.3, " must", fontsize=8)
    axes[0].text(axes[0].get_xlim()[0], GOAL + 0.3, " goal", fontsize=8)
    axes[1].legend(frameon=False, fontsize=7, ncols=2, loc="lower right")
    fig.savefig(path, dpi=150)


def main() -> None:
    """Measure, print, judge."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--spacings-2d", type=float, nargs="*", default=[0.008, 0.004, 0.002])
    parser.add_argument("--spacings-3d", type=float, nargs="*", default=[0.02, 0.014, 0.01])
    parser.add_argument("--times", type=float, nargs=3, default=[0.02, 0.42, 0.7], help="of " + ", ".join(INSTANTS))
    parser.add_argument("--sizes", type=float, nargs="*", default=[1e4, 1e5, 1e6])
    parser.add_argument("--dimensions", type=int, nargs="*", default=[2, 3], choices=[2, 3], help="of generated ones")
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--figure", type=Path)
    parser.add_argument("--from", dest="files", type=Path, nargs="*", default=[], help="judge these results, too")
    asked = parser.parse_args()
    kernels.initialize("cpu", asked.threads)
    results = [r for file in asked.files for r in json.loads(file.read_text(encoding="utf-8"))]
    print(HEAD, flush=True)
    for r in results:
        print(line(r))
    for d, spacings in ((2, asked.spacings_2d), (3, asked.spacings_3d)):
        for spacing in spacings:
            results += computed(d, spacing, asked.times, asked.repeats)
            _write(results, asked.json)
    for d in asked.dimensions:
        for size in asked.sizes:
            results += generated(d, size, asked.repeats)
            _write(results, asked.json)
    print("\n".join(verdict(results)))
    if asked.figure:
        figure(results, asked.figure)


def _write(results: list[dict[str, Any]], file: Path | None) -> None:
    if file:
        file.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
