"""A few steps of the 3D dam break with as many particles as a device holds: time of each, and the card's memory.

    python benchmarks/large_run.py --spacing 0.000683 --device cuda --precision single [--steps 9]

Prints as it goes, so that a run that ends for want of memory has said how far it came.
"""

import argparse
import subprocess
import time
from statistics import mean, median

from spume import kernels, load

WARM_UP = 3
"""Steps before those that count: kernels are compiled, storage grows."""


def memory_of_card() -> str:
    """Return what the card's own tool says of its memory, nothing where there is no such tool."""
    command = ["nvidia-smi", "--query-gpu=memory.used,memory.total", "--format=csv,noheader"]
    try:
        return subprocess.run(command, capture_output=True, text=True).stdout.strip()
    except OSError:
        return ""


def main() -> None:
    """Run."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--case", default="dam-break-3d")
    parser.add_argument("--spacing", type=float, required=True, help="[m]")
    parser.add_argument("--device", default="cuda", choices=kernels.DEVICES)
    parser.add_argument("--precision", default="single", choices=kernels.PRECISIONS)
    parser.add_argument("--steps", type=int, default=9)
    asked = parser.parse_args()
    begin = time.perf_counter()
    case = load(asked.case, [f"spacing={asked.spacing!r}"])
    simulation = case.build(device=asked.device, precision=asked.precision)
    particles, pairs, system = simulation.particles, simulation.domain.pairs, simulation.domain.system
    kernels.wait()
    print(f"{particles.count:,} rows after {time.perf_counter() - begin:.1f} s; card: {memory_of_card()}", flush=True)
    times = []
    for step in range(asked.steps):
        started = time.perf_counter()
        simulation.advance()
        kernels.wait()
        times.append(time.perf_counter() - started)
        iterations = simulation.statistics.get("iterations", 0.0)
        print(f"step {step}: {times[-1]:.3f} s, {iterations:.0f} iterations; card: {memory_of_card()}", flush=True)
    held = (particles.bytes() + pairs.list.bytes() + system.bytes()) / particles.count
    print(f"{particles.active:,} rows take part; table, lists and matrix {held:,.0f} B per row")
    print(
        f"last {len(times[WARM_UP:])} steps: median {median(times[WARM_UP:]):.3f} s, mean {mean(times[WARM_UP:]):.3f} s"
    )


if __name__ == "__main__":
    main()
