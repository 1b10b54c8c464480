"""Cost of the neighbour search: sort and list of 1 million particles in 3D, re = 2.1 l0.

    python benchmarks/neighbour_list.py [--threads 1 2]

Prints microseconds per particle as medians of 7 builds, the bytes that a build must move at least, and the
bandwidth of a copy measured in the same run.
"""

import argparse
import time
from statistics import median

import numpy as np

from spume import kernels
from spume.pairs import Pairs
from spume.particles import Particles


def build_times(n: int, threads: int, skin: float) -> tuple[list[float], float, Pairs]:
    """Return wall times [s] of 7 builds, the bandwidth of a copy [GB/s] and the pairs."""
    kernels.initialize("cpu", threads)
    axis = (np.arange(n) + 0.5) / n
    x = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    x += np.random.default_rng(1).uniform(-0.1, 0.1, x.shape) / n
    particles = Particles(3, 1.0 / n, capacity=len(x))
    particles.insert({"position": x, "kind": np.ones(len(x), int)})
    pairs = Pairs(2.1 / n, skin / n, [-1.0] * 3, [2.0] * 3)
    times = []
    for _ in range(9):
        begin = time.perf_counter()
        pairs.list.build(particles)
        kernels.wait()
        times.append(time.perf_counter() - begin)
    data = np.ones(20_000_000)
    target = np.empty_like(data)
    copies = []
    for _ in range(5):
        begin = time.perf_counter()
        np.copyto(target, data)
        copies.append(time.perf_counter() - begin)
    return times[2:], 2 * data.nbytes / median(copies) / 1e9, pairs


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--threads", type=int, nargs="*", default=[1, 2])
    n = 100
    for threads in parser.parse_args().threads:
        for skin in (0.0, 0.1):
            times, copy, pairs = build_times(n, threads, skin)
            neighbours = float(np.mean(pairs.list.length.to_numpy()[: n**3]))
            # Positions read once, every restart field gathered (read and written), the list written.
            least = 24 + 2 * 180 + 12 + 4 * neighbours
            rate = least * n**3 / median(times) / 1e9
            print(
                f"{threads} threads, skin {skin} l0: {median(times) * 1e6 / n**3:.3f} us per particle "
                f"(best {min(times) * 1e6 / n**3:.3f}), {neighbours:.1f} neighbours, {pairs.list.bytes() / n**3:.0f} B "
                f"per row; at least {least:.0f} B moved, {rate:.1f} of {copy:.1f} GB/s (copy, one thread)"
            )


if __name__ == "__main__":
    main()
