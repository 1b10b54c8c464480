"""Cost of a whole step by stage: the 3D dam break at a spacing, without output.

python benchmarks/step.py [spacing [threads [steps [solver]]]]
"""

import resource
import sys
import time
from statistics import median

from spume.build import build
from spume.case import load


def main() -> None:
    """Run the steps, print microseconds per fluid particle and step by stage."""
    spacing = sys.argv[1] if len(sys.argv) > 1 else "0.01"
    threads = int(sys.argv[2]) if len(sys.argv) > 2 else 2
    steps = int(sys.argv[3]) if len(sys.argv) > 3 else 30
    settings = [f"spacing={spacing}"] + ([f"step.solver={sys.argv[4]}"] if len(sys.argv) > 4 else [])
    simulation = build(load("dam-break-3d", settings), threads=threads)
    fluid = int(simulation.snapshot().fluid.sum())
    for _ in range(3):
        simulation.advance()
    simulation.stage_times.clear()
    times, iterations = [], []
    for _ in range(steps):
        begin = time.perf_counter()
        simulation.advance()
        times.append(time.perf_counter() - begin)
        iterations.append(simulation.statistics["iterations"])
    rows = simulation.particles.count
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    print(f"spacing {spacing} m, {fluid} fluid particles, {rows} rows, {threads} threads")
    print(
        f"  step: median {median(times) / fluid * 1e6:.2f} us per fluid particle ({min(times) / fluid * 1e6:.2f} best)"
    )
    print(
        f"        {median(times) / rows * 1e6:.2f} us per row; mean dt {simulation.time / simulation.step_index:.2e} s"
    )
    for name, seconds in sorted(simulation.stage_times.items(), key=lambda item: -item[1]):
        print(f"  {name:12s} {seconds / steps / fluid * 1e6:7.3f} us per fluid particle and step")
    print(f"  iterations: {sum(iterations) / steps:.1f}; memory, all in: {memory / rows:.0f} B per row")


if __name__ == "__main__":
    main()
