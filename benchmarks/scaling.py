"""Cost of a step over size and threads, 2D and 3D: `spume bench` of the dam break, each in a process of its own.

    python benchmarks/scaling.py [--sizes 1e4 1e5 1e6] [--dimensions 2 3] [--threads 1 2] [--steps 15]
        [--repeat 1] [--device cpu] [--json FILE] [--figure FILE]

A size is the number of fluid particles that is aimed at. Of several repetitions the one with the median step is taken.
The table is printed as it grows; the bars of the project are printed below it.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

CASES = {2: ("dam-break", 0.6 * 0.3), 3: ("dam-break-3d", 0.6 * 0.15 * 0.3)}
"""Case of each dimension, and the area [m^2] or volume [m^3] of its water."""


def measured(size: float, dimension: int, threads: int, args: argparse.Namespace) -> dict[str, Any]:
    """Return the figures of one combination."""
    case, volume = CASES[dimension]
    spacing = (volume / size) ** (1.0 / dimension)
    found = []
    with tempfile.TemporaryDirectory() as scratch:
        for k in range(args.repeat):
            file = Path(scratch) / f"{k}.json"
            command = ["bench", case, "--spacing", f"{spacing:.4g}", "--steps", str(args.steps), "--threads"]
            command += [str(threads), "--json", str(file)] + (["--device", args.device] if args.device else [])
            done = subprocess.run([sys.executable, "-m", "spume", *command], capture_output=True, text=True)
            if done.returncode:
                raise SystemExit(f"spume {' '.join(command)}\n{done.stderr[-2000:]}")
            found.append(json.loads(file.read_text()))
    return sorted(found, key=lambda result: result["median_step"])[len(found) // 2]


def row(result: dict[str, Any]) -> str:
    """Return a line of the table."""
    stages = {stage["name"]: stage["seconds"] / result["fluid"] * 1e6 for stage in result["stages"]}
    return (
        f"| {result['dimension']}D | {result['fluid']:,} | {result['rows']:,} | {result['threads']} | "
        f"{result['us_per_fluid_particle_step']:.2f} | {stages.get('search', 0):.2f} | "
        f"{stages.get('assembly', 0):.2f} | {stages.get('solve', 0):.2f} | {result['iterations']:.1f} | "
        f"{result['peak_memory'] / result['rows']:,.0f} | {result['table_memory'] / result['rows']:,.0f} | "
        f"{result['compilation']:.0f} |"
    )


def bars(results: list[dict[str, Any]]) -> list[str]:
    """Return what the measured ratios say of the project's bars."""
    lines = []
    by = {(r["dimension"], r["aim"], r["threads"]): r for r in results}
    for (dimension, aim, threads), result in by.items():
        one = by.get((dimension, aim, 1))
        if threads == 2 and one is not None:
            gain = one["median_step"] / result["median_step"]
            lines.append(
                f"{dimension}D, {result['fluid']:,} fluid particles: 2 threads are {gain:.2f} times as fast as 1"
            )
        million = by.get((dimension, 1e6, threads))
        if aim > 1e6 and million is not None:
            ratio = result["us_per_fluid_particle_step"] / million["us_per_fluid_particle_step"]
            lines.append(f"{dimension}D: a particle of {result['fluid']:,} costs {ratio:.2f} of one of a million")
    return lines


def figure(results: list[dict[str, Any]], path: Path) -> None:
    """Draw cost and memory over size."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    fig, (left, right) = plt.subplots(1, 2, figsize=(9, 3.6), constrained_layout=True)
    for index, key in enumerate(sorted({(r["dimension"], r["threads"]) for r in results})):
        mine = sorted((r for r in results if (r["dimension"], r["threads"]) == key), key=lambda r: r["fluid"])
        label = f"{key[0]}D, {key[1]} thread{'s' if key[1] > 1 else ''}"
        style = {
            "color": plt.get_cmap("cividis")(0.2 + 0.6 * (key[0] - 2)),
            "marker": "os^d"[index % 4],
            "label": label,
        }
        style["linestyle"] = "-" if key[1] > 1 else "--"
        left.plot([r["fluid"] for r in mine], [r["us_per_fluid_particle_step"] for r in mine], **style)
        right.plot([r["rows"] for r in mine], [r["peak_memory"] / r["rows"] for r in mine], **style)
    left.set(xscale="log", xlabel="fluid particles", ylabel="µs per fluid particle and step", ylim=(0, None))
    right.set(
        xscale="log", yscale="log", xlabel="rows of the table, walls included", ylabel="memory, all in [bytes per row]"
    )
    left.legend(frameon=False)
    for ax in (left, right):
        ax.grid(alpha=0.3)
        ax.spines[["top", "right"]].set_visible(False)
    fig.savefig(path, dpi=150)


def main() -> None:
    """Measure every combination; print the table as it grows."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--sizes", type=float, nargs="+", default=[1e4, 1e5, 1e6])
    parser.add_argument("--dimensions", type=int, nargs="+", default=[2, 3], choices=[2, 3])
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--steps", type=int, default=15)
    parser.add_argument("--repeat", type=int, default=1)
    parser.add_argument("--device")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--figure", type=Path)
    args = parser.parse_args()
    heads = "| | fluid | rows | threads | µs per fluid particle and step | search | assembly | solve | iterations "
    print(heads + "| B per row, all in | table, lists, matrix | first steps [s] |")
    print("|" + "---|" * 12, flush=True)
    results = []
    for dimension in args.dimensions:
        for size in args.sizes:
            for threads in args.threads:
                results.append(measured(size, dimension, threads, args) | {"aim": size})
                print(row(results[-1]), flush=True)
    print("\n".join(["", *bars(results)]))
    if args.json:
        args.json.write_text(json.dumps(results, indent=1) + "\n", encoding="utf-8")
    if args.figure:
        figure(results, args.figure)


if __name__ == "__main__":
    main()
