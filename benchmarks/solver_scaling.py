"""Iterations and cost of the pressure solver over the size of the system.

    python benchmarks/solver_scaling.py [--sizes 1e4 1e5 1e6] [--dimensions 2 3] [--device D] [--threads N]
        [--precision P] [--arrangements column …] [--dam-break 0.02 0.01] [--repeats 5] [--json FILE]

From a zero start to a relative residual of 1e-6. Times are medians; the product is one of the matrix with a vector, in
the same storage and with as many threads, measured in the same run. 1e7 rows need 16 GB.
"""

import argparse
import json
import time
from statistics import median
from typing import Any

import numpy as np
from pressure_systems import ARRANGEMENTS, INTERFACES, assembled, dam_break, reset

from spume import kernels
from spume.particles import Particles
from spume.pressure.entries import Entries, matrix_type, row_sum
from spume.pressure.matrix import UNKNOWN, LinearSystem
from spume.pressure.multigrid import Multigrid, coarse_levels

TOLERANCE = 1e-6


@kernels.cached
def product_kernel(entries: Entries) -> Any:
    """Return the kernel y = A x over the rows that have an equation."""
    real = kernels.runtime().real
    Reals, Rows, Matrix = kernels.array_type(real), kernels.array_type(kernels.i32), matrix_type(entries)
    serial, qd = kernels.runtime().serial, kernels.qd
    add = row_sum(Matrix, entries, "+", real, real)

    @kernels.kernel
    def product(matrix: Matrix, diagonal: Reals, state: Rows, x: Reals, y: Reals, count: kernels.i32):
        qd.loop_config(serialize=serial)
        for i in range(count):
            if state[i] == UNKNOWN:
                y[i] = add(matrix, i, 0, x, diagonal[i] * x[i])

    return product


def seconds(action: Any, repeats: int, before: Any = lambda: None) -> float:
    """Return the median wall time [s] of an action."""
    times = []
    for _ in range(repeats):
        before()
        kernels.wait()
        begin = time.perf_counter()
        action()
        kernels.wait()
        times.append(time.perf_counter() - begin)
    return median(times)


def measured(name: str, particles: Particles, system: LinearSystem, repeats: int) -> dict[str, Any]:
    """Solve from zero; return iterations, sizes and median times."""
    solver = Multigrid(tolerance=TOLERANCE)
    product = product_kernel(system.entries)
    rows = int((particles.numpy(system.state) == UNKNOWN).sum())
    entries = int(particles.numpy(system.length).sum())
    arrays = [particles[n] for n in (system.diagonal, system.state, "cg_direction", "cg_product")]
    arrays.insert(0, system.matrix(particles))
    particles.set("cg_direction", np.random.default_rng(0).normal(size=particles.count))
    reset(particles, system)
    solution = solver(system, particles)
    sizes = coarse_levels(particles.dimension)
    products, solves, starts = [], [], []
    # In turn, so that what else runs on the machine disturbs all alike.
    for _ in range(repeats):
        products.append(seconds(lambda: product(*arrays, particles.active), 3))
        solves.append(seconds(lambda: solver(system, particles), 1, lambda: reset(particles, system)))
        # From the solution, no iteration is left: the levels and one residual.
        starts.append(seconds(lambda: Multigrid(tolerance=10 * TOLERANCE)(system, particles), 1))
    one, full, set_up = median(products), median(solves), median(starts)
    return {
        "arrangement": name, "dimension": particles.dimension, "rows": rows, "entries per row": entries / rows + 1,
        "iterations": solution.iterations, "fallbacks": solution.fallbacks, "levels": len(sizes) + 1,
        "complexity": (rows + entries + sum(a + b for a, b in sizes)) / (rows + entries),
        "product": one, "set-up": set_up, "solve": full, "ratio": full / one, "set-up ratio": set_up / one,
    }  # fmt: skip


HEAD = (
    f"{'arrangement':<18} {'d':>1} {'rows':>9} {'entries':>7} {'iterations':>10} {'levels':>6} {'complexity':>10} "
    f"{'product':>9} {'set-up':>9} {'solve':>9} {'set-up/product':>14} {'solve/product':>13}"
)


def line(r: dict[str, Any]) -> str:
    """Return a result as a line of the table; times in ms."""
    iterations = f"{r['iterations']}" + (" (cg)" if r["fallbacks"] else "")
    return (
        f"{r['arrangement']:<18} {r['dimension']} {r['rows']:>9} {r['entries per row']:7.1f} {iterations:>10} "
        f"{r['levels']:>6} {r['complexity']:10.2f} {1e3 * r['product']:9.2f} {1e3 * r['set-up']:9.1f} "
        f"{1e3 * r['solve']:9.1f} {r['set-up ratio']:14.1f} {r['ratio']:13.1f}"
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sizes", type=float, nargs="*", default=[1e4, 1e5, 1e6])
    parser.add_argument("--dimensions", type=int, nargs="*", default=[2, 3])
    parser.add_argument("--arrangements", nargs="*", default=list(ARRANGEMENTS), choices=[*ARRANGEMENTS, *INTERFACES])
    parser.add_argument("--dam-break", type=float, nargs="*", default=[], help="spacings [m] of the 3D dam break")
    parser.add_argument("--time", type=float, default=0.4, help="of the dam break [s]")
    parser.add_argument("--device", default="cpu", choices=kernels.DEVICES)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--precision", default="double", choices=kernels.PRECISIONS)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--json", help="write the figures to this file as well")
    asked = parser.parse_args()
    runtime = kernels.initialize(asked.device, asked.threads, asked.precision)
    print(f"{runtime.threads} threads, {runtime.precision} precision, relative residual {TOLERANCE:g} from zero; ms")
    print(HEAD, flush=True)
    found = []
    for d in asked.dimensions:
        for name in asked.arrangements:
            for size in asked.sizes:
                found.append(measured(name, *assembled(name, int(size), d), asked.repeats))
                print(line(found[-1]), flush=True)
    for spacing in asked.dam_break:
        system = dam_break(spacing, asked.time, threads=asked.threads)
        found.append(measured(f"dam break {spacing:g} m", *system, asked.repeats))
        print(line(found[-1]), flush=True)
    if asked.json:
        with open(asked.json, "w", encoding="utf-8") as file:
            json.dump({"threads": runtime.threads, "precision": runtime.precision, "results": found}, file, indent=2)


if __name__ == "__main__":
    main()
