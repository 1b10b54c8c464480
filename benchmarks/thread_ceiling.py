"""How much a second thread gives, beside how much a second processor of this machine gives at all.

    python benchmarks/thread_ceiling.py [--size 2e5] [--steps 12] [--repeat 3] [--json FILE]

In turn: one process with one thread; two such processes beside each other, which share nothing but the machine; one
process with two threads. Where processors are shares of others, as in virtual machines, two processes do not do twice
the work of one in the same time: what they do is the most that two threads can reach. Medians over the repetitions.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median
from typing import Any

VOLUME = 0.6 * 0.15 * 0.3
"""Water of dam-break-3d [m^3]."""


def started(spacing: float, threads: int, steps: int, file: Path) -> subprocess.Popen[str]:
    """Start a benchmark that writes its figures to a file."""
    command = [sys.executable, "-m", "spume", "bench", "dam-break-3d", "--spacing", f"{spacing:.4g}"]
    command += ["--steps", str(steps), "--threads", str(threads), "--json", str(file)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def step_times(spacing: float, threads: int, steps: int, processes: int) -> list[float]:
    """Return the median time of a step [s] in each of some processes beside each other."""
    with tempfile.TemporaryDirectory() as folder:
        files = [Path(folder) / f"{k}.json" for k in range(processes)]
        running = [started(spacing, threads, steps, file) for file in files]
        for process in running:
            _, errors = process.communicate()
            if process.returncode:
                raise SystemExit(errors[-2000:])
        return [float(json.loads(file.read_text())["median_step"]) for file in files]


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=float, default=2e5, help="fluid particles that are aimed at")
    parser.add_argument("--steps", type=int, default=12)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--json", type=Path)
    asked = parser.parse_args()
    spacing = (VOLUME / asked.size) ** (1.0 / 3.0)
    found: list[dict[str, Any]] = []
    for _ in range(asked.repeat):
        one = step_times(spacing, 1, asked.steps, 1)[0]
        beside = step_times(spacing, 1, asked.steps, 2)
        two = step_times(spacing, 2, asked.steps, 1)[0]
        ceiling = sum(one / time for time in beside)
        found.append({"one": one, "beside": beside, "two": two, "gain": one / two, "ceiling": ceiling})
        print(
            f"one thread {one:.3f} s a step; two processes {beside[0]:.3f} and {beside[1]:.3f} s, {ceiling:.2f} times "
            f"the work of one; two threads {two:.3f} s, {one / two:.2f} times as fast",
            flush=True,
        )
    gain, ceiling = median(f["gain"] for f in found), median(f["ceiling"] for f in found)
    print(f"median: two threads {gain:.2f}, two processes {ceiling:.2f}")
    if asked.json:
        asked.json.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
