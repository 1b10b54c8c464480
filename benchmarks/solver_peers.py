"""Multigrid beside conjugate gradients with the diagonal, and beside pyamg on the exported matrix.

    python benchmarks/solver_peers.py [--size 1e4] [--dimensions 2 3] [--arrangements column film bubbles]

From zero to a relative residual of 1e-6, one thread. pyamg (extra: benchmarks) preconditions conjugate gradients
with one V-cycle of its default smoothed aggregation, and with a W-cycle of unsmoothed aggregation. Times in ms,
set-up included.
"""

import argparse
import time
from typing import Any

import numpy as np
from pressure_systems import ARRANGEMENTS, INTERFACES, assembled, reset, sparse

from spume import kernels
from spume.pressure.conjugate_gradient import ConjugateGradient
from spume.pressure.multigrid import Multigrid

TOLERANCE = 1e-6


def of_spume(solver: Any, particles: Any, system: Any) -> tuple[int, float]:
    """Return iterations and time [s] of the second solve, for which nothing is compiled."""
    for _ in range(2):
        reset(particles, system)
        begin = time.perf_counter()
        solution = solver(system, particles)
        kernels.wait()
    return solution.iterations, time.perf_counter() - begin


def of_pyamg(matrix: Any, right: np.ndarray, smooth: Any, cycle: str) -> tuple[int, float]:
    """Return iterations and time [s]."""
    import pyamg
    from scipy.sparse.linalg import cg

    count = 0

    def counted(_: np.ndarray) -> None:
        nonlocal count
        count += 1

    begin = time.perf_counter()
    levels = pyamg.smoothed_aggregation_solver(matrix, smooth=smooth)
    cg(matrix, right, rtol=TOLERANCE, maxiter=500, M=levels.aspreconditioner(cycle=cycle), callback=counted)
    return count, time.perf_counter() - begin


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--size", type=float, default=1e4)
    parser.add_argument("--dimensions", type=int, nargs="*", default=[2, 3])
    parser.add_argument("--arrangements", nargs="*", default=["column", "film", "bubbles"])
    asked = parser.parse_args()
    assert set(asked.arrangements) <= {*ARRANGEMENTS, *INTERFACES}
    kernels.initialize("cpu", 1, "double")
    print("arrangement  d    rows |     multigrid |  cg, diagonal | pyamg smoothed | unsmoothed: iterations and ms")
    for d in asked.dimensions:
        for name in asked.arrangements:
            particles, system = assembled(name, int(asked.size), d)
            matrix, right = sparse(particles, system)
            found = [of_spume(s(tolerance=TOLERANCE), particles, system) for s in (Multigrid, ConjugateGradient)]
            found += [of_pyamg(matrix, right, "jacobi", "V"), of_pyamg(matrix, right, None, "W")]
            cells = " | ".join(f"{count:>4} {1e3 * seconds:8.1f}" for count, seconds in found)
            print(f"{name:<12} {d} {matrix.shape[0]:>7} | {cells}", flush=True)


if __name__ == "__main__":
    main()
