"""Whether a loop over few long parts keeps all threads busy: plain, and stretched by ``kernels.spread``.

    python benchmarks/long_parts.py [--threads 2] [--parts 32]

Printed are wall time and processor time over wall time of this process, which is the number of threads that worked;
on a machine that does other work it is less than that.
"""

import argparse
import time
from typing import Any

from spume import kernels

ROWS = 100_000


def looped(parts: int, spread: int) -> Any:
    """Return the kernel that works on ``ROWS`` numbers in so many parts, each stretched over ``spread`` iterations."""
    Reals, qd = kernels.array_type(kernels.runtime().real), kernels.qd

    @kernels.kernel
    def loop(a: Reals, count: kernels.i32):
        qd.loop_config(block_dim=1)
        for t in range(parts * spread):
            if t % spread == 0:
                b = t // spread
                for i in range(count // parts * b, count // parts * (b + 1)):
                    s = a[i]
                    for _ in range(30):
                        s = qd.sqrt(s * s + 1.0)
                    a[i] = s

    return loop


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--parts", type=int, default=32)
    asked = parser.parse_args()
    kernels.initialize("cpu", asked.threads)
    numbers = kernels.array(kernels.runtime().real, ROWS)
    for name, spread in (("plain", 1), ("stretched", kernels.spread(asked.parts))):
        kernel = looped(asked.parts, spread)
        kernel(numbers, ROWS)
        kernels.wait()
        wall, processor = time.perf_counter(), time.process_time()
        for _ in range(50):
            kernel(numbers, ROWS)
        kernels.wait()
        wall, processor = time.perf_counter() - wall, time.process_time() - processor
        print(f"{name:<9} {asked.parts} parts: {20 * wall:6.2f} ms a loop, {processor / wall:.2f} threads at work")


if __name__ == "__main__":
    main()
