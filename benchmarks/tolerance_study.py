"""What the solver's tolerance does to a simulation: the study behind its default.

    python benchmarks/tolerance_study.py [--cells 40] [--spacing-3d 0.02] [--cases rest wave 2D 3D] [--json FILE]

Water at rest (H/l0 = 20) and a standing wave (h/l0 = 20), as in validation/settings; the dam break of Lobovsky et al.
in 2D with H/l0 cells, and in 3D. Either the relative residual (``tolerance``, with a ``volume_error`` of 0) or the
change of volume in a step (``volume_error``, with a tolerance of 1e-9 that never decides) is varied. Deviations of
pressures and levels are root mean squares against the experiment, means over the gauges; drift is the largest change
of the fluid's volume. One thread; iterations and time of the solves are per step.
"""

import argparse
import json
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1] / "validation" / "settings"))

import check

from spume.case import load

SETTINGS = [
    *[("tolerance", value) for value in (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7)],
    *[("volume_error", value) for value in (1e-3, 1e-4, 1e-5, 1e-6)],
]


def overrides(name: str, value: float) -> list[str]:
    """Return the settings of a case."""
    found = [f"step.solver.{name}={value!r}"]
    return [*found, "step.solver.volume_error=0" if name == "tolerance" else "step.solver.tolerance=1e-9"]


def dam_break(name: str, spacing: float, settings: list[str]) -> dict[str, float]:
    """Run a dam break; return deviations from the experiment, and cost."""
    case = load(name, [f"spacing={spacing!r}", "output.pictures=false", "output.animation=none", *settings])
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "run"
        case.run(folder, threads=1)
        summary = json.loads((folder / "summary.json").read_text())
    found = {entry["gauge"]: entry for entry in summary["comparison"]}

    def mean(kind: str) -> float:
        values = [entry["rms"] for gauge, entry in found.items() if gauge.startswith(kind)]
        return sum(values) / len(values)

    return {
        "pressure rms": mean("pressure"), "peak": found["pressure-2"]["peak"], "level rms": mean("level"),
        "drift": summary["volume_drift"], "steps": summary["steps"],
        "collisions": summary["counts"].get("collisions", 0),
        "iterations": summary["pressure_iterations_mean"],
        "solve": 1e3 * summary["stage_times"].get("solve", 0.0) / summary["steps"],
        "step": 1e3 * summary["wall_time_steps"] / summary["steps"],
    }  # fmt: skip


def text_of(case: str, r: dict[str, float]) -> str:
    """Return the figures of one case as a part of a line."""
    if case == "rest":
        return f"{100 * r['error']:5.3f} % {r['kinetic']:.1e} {r['iterations']:4.1f}"
    if case == "wave":
        return f"{100 * r['lost']:5.2f} % {r['iterations']:4.1f}"
    return (
        f"{r['pressure rms']:.3f} {r['peak']:.2f} {100 * r['level rms']:.2f} % {100 * r['drift']:.2f} % "
        f"{r['collisions']:.0f} {r['iterations']:4.1f} {r['solve']:5.1f} {r['step']:5.1f} {r['steps']}"
    )


HEADS = {
    "rest": "at rest: rms p, kinetic energy, iterations",
    "wave": "wave: lost a period, iterations",
    "2D": "2D",
    "3D": "3D dam break: rms p, peak, rms levels, drift, collisions, iterations, ms solve, ms step, steps",
}


def main() -> None:
    """Run every setting; print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=40)
    parser.add_argument("--spacing-3d", type=float, default=0.02)
    parser.add_argument("--cases", nargs="*", default=list(HEADS), choices=list(HEADS))
    parser.add_argument("--json", help="write the figures to this file as well")
    asked = parser.parse_args()
    runs: dict[str, Callable[[list[str]], dict[str, float]]] = {
        "rest": check.at_rest,
        "wave": check.wave,
        "2D": lambda settings: dam_break("dam-break", 0.3 / asked.cells, settings),
        "3D": lambda settings: dam_break("dam-break-3d", asked.spacing_3d, settings),
    }
    print(" | ".join(["setting", *(HEADS[case] for case in asked.cases)]))
    rows: list[dict[str, Any]] = []
    for name, value in SETTINGS:
        settings = overrides(name, value)
        rows.append({"setting": name, "value": value, **{case: runs[case](settings) for case in asked.cases}})
        cells = (text_of(case, rows[-1][case]) for case in asked.cases)
        print(" | ".join([f"{name:<12} {value:5.0e}", *cells]), flush=True)
        if asked.json:
            Path(asked.json).write_text(json.dumps(vars(asked) | {"rows": rows}, indent=2, default=float) + "\n")


if __name__ == "__main__":
    main()
