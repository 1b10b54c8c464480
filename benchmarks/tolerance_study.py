"""What the solver's tolerance does to a simulation: the study behind its default.

    python benchmarks/tolerance_study.py [--cells 40] [--spacing-3d 0.02] [--json FILE]

Water at rest (H/l0 = 20) and a standing wave (h/l0 = 20), as in validation/settings; the dam break of Lobovsky et al.
in 2D with H/l0 cells, and in 3D. Either the relative residual (``tolerance``) or the change of volume in a step
(``volume_error``, with a tolerance of 1e-9 that never decides) is varied. Deviations of pressures and levels are root
mean squares against the experiment, means over the gauges; drift is the largest change of the fluid's volume. One
thread; iterations and time of the solves are per step.
"""

import argparse
import json
import sys
import tempfile
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
    return found if name == "tolerance" else [*found, "step.solver.tolerance=1e-9"]


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


def main() -> None:
    """Run every setting; print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=40)
    parser.add_argument("--spacing-3d", type=float, default=0.02)
    parser.add_argument("--json", help="write the figures to this file as well")
    asked = parser.parse_args()
    print(
        "                       | at rest:         | wave:   | dam break, 2D and 3D: rms of pressures, peak / measured,"
    )
    print(
        "                       | rms p, kinetic   | lost    |"
        " rms of levels, drift, iterations, ms solve, ms step, steps"
    )
    rows: list[dict[str, Any]] = []
    for name, value in SETTINGS:
        settings = overrides(name, value)
        row: dict[str, Any] = {"setting": name, "value": value}
        row |= {"rest": check.at_rest(settings), "wave": check.wave(settings)}
        row["2D"] = dam_break("dam-break", 0.3 / asked.cells, settings)
        row["3D"] = dam_break("dam-break-3d", asked.spacing_3d, settings)
        rows.append(row)
        rest = row["rest"]
        text = f"{name:<12} {value:9.0e} | {100 * rest['error']:5.3f} % {rest['kinetic']:.1e} | "
        text += f"{100 * row['wave']['lost']:5.2f} %"
        for d in ("2D", "3D"):
            r = row[d]
            text += (
                f" | {r['pressure rms']:.3f} {r['peak']:.2f} {100 * r['level rms']:.2f} % {100 * r['drift']:.2f} % "
                f"{r['iterations']:4.1f} {r['solve']:5.1f} {r['step']:5.1f} {r['steps']}"
            )
        print(text, flush=True)
        if asked.json:
            Path(asked.json).write_text(json.dumps(vars(asked) | {"rows": rows}, indent=2, default=float) + "\n")


if __name__ == "__main__":
    main()
