"""Conjugate gradients with the diagonal as preconditioner."""

from typing import Any, ClassVar

import numpy as np

from spume import kernels, lanes
from spume.particles import Field, Particles
from spume.pressure.base import LOOSEST, NotConverged, Solution, Solver, square_of_row
from spume.pressure.entries import Entries, matrix_type, row_sum
from spume.pressure.matrix import UNKNOWN, LinearSystem

BLOCKS = 128
"""Sums are made of this many partial sums, whatever the number of threads: the same bits every time (see `lanes`)."""


class ConjugateGradient(Solver, name="cg"):
    """Preconditioned conjugate gradients (Hestenes & Stiefel 1952), preconditioner: the diagonal.

    For symmetric matrices. One iteration reads the matrix once and six vectors.
    """

    ids: ClassVar = ("A4",)
    reference: ClassVar = "hestenes1952"
    symmetric_only: ClassVar = True
    vectors: ClassVar = ("cg_residual", "cg_direction", "cg_product")
    needs: ClassVar = (
        Field("cg_residual", (), "1/s^2", "residual r"),
        Field("cg_direction", (), "Pa", "search direction p", scratch="solver"),
        Field("cg_product", (), "1/s^2", "A p", scratch="solver"),
    )

    def __call__(self, system: LinearSystem, particles: Particles) -> Solution:
        """Solve for the unknown rows of the system."""
        start, iterate = _kernels(system.entries)
        partial, scalars, running = workspace(lanes.room_for_sums(particles.capacity, BLOCKS))
        vectors = [particles[n] for n in (system.solution, *self.vectors, system.diagonal)]
        matrix = system.matrix(particles)
        start(
            matrix, *vectors, particles[system.rhs], particles[system.state], partial, scalars, running,
            self.tolerance, *negligible(system, self), particles.active,
        )  # fmt: skip
        if int(kernels.host(running)) == 1:
            iterate(
                matrix,
                *vectors,
                partial,
                scalars,
                running,
                self.tolerance,
                self.largest_iterations,
                particles.active,
            )
        return solution(kernels.host(scalars), self)


def negligible(system: LinearSystem, solver: Solver) -> tuple[float, float]:
    """Return what a row adds to the square of the norm that the residual is relative to, and at most by what factor."""
    return (system.negligible / solver.tolerance) ** 2, max((LOOSEST / solver.tolerance) ** 2 - 1.0, 0.0)


def solution(scalars: Any, solver: Solver) -> Solution:
    """Return the solution's figures from (b.b, r.r, …, iterations at 4).

    Raises:
        NotConverged: the residual is above the tolerance or not a number.
    """
    right, rest, iterations = float(scalars[0]), float(scalars[1]), int(scalars[4])
    # A right side of zero has the solution zero; one that is not a number must not pass for it.
    residual = 0.0 if right == 0.0 and np.isfinite(rest) else float(np.sqrt(np.divide(rest, right)))
    # The recurrence may stop a hair above the tolerance in rounding; twice that is a failure.
    if not residual <= 2.0 * solver.tolerance:
        raise NotConverged(
            f"{solver.key}: relative residual {residual:.3g} after {iterations} iterations, "
            f"tolerance {solver.tolerance:g}"
        )
    return Solution(iterations, residual)


@kernels.cached
def workspace(sums: int, width: int = 3) -> Any:
    """Return the arrays of so many partial sums of ``width`` numbers, of an iteration's scalars, and its flag."""
    real = kernels.runtime().real
    return kernels.array(real, width * sums), kernels.array(real, 8), kernels.scalar_array(kernels.i32)


@kernels.cached
def _kernels(entries: Entries) -> Any:
    """Return the kernels that start and that iterate.

    The stages of an iteration are functions of one block of rows. With several threads each stage is a
    parallel loop over blocks and the iteration a loop on the device; with one thread all of it is one
    plain loop, which costs a single launch per solve.
    """
    real = kernels.runtime().real
    Matrix = matrix_type(entries)
    Reals, Rows = (kernels.array_type(t) for t in (real, kernels.i32))
    Flag = kernels.qd.types.ndarray(dtype=kernels.i32, ndim=0)
    qd, blocks = kernels.qd, BLOCKS
    serial = kernels.runtime().serial and not kernels.runtime().wide

    add, subtract = (row_sum(Matrix, entries, sign, real, real) for sign in "+-")

    every, row = lanes.parts_of().every, lanes.parts_of().row
    fold, total = lanes.fold().fold, lanes.fold().total

    @kernels.func
    def residual(
        b: kernels.i32, matrix: Matrix, x: Reals, r: Reals, p: Reals,
        diagonal: Reals, rhs: Reals, state: Rows, partial: Reals, floor: real, loosest: real, count: kernels.i32,
    ):  # fmt: skip
        rr = qd.cast(0, real)
        rz = qd.cast(0, real)
        bb = qd.cast(0, real)
        for i in range(row(b, every(blocks, count), count), row(b + 1, every(blocks, count), count)):
            rest = qd.cast(0, real)
            if state[i] == UNKNOWN:
                rest = subtract(matrix, i, 0, x, rhs[i] - diagonal[i] * x[i])
                bb += square_of_row(rhs[i], diagonal[i] * x[i], floor, loosest)
            r[i] = rest
            p[i] = rest / diagonal[i]
            rr += rest * rest
            rz += rest * p[i]
        partial[3 * b] = bb
        partial[3 * b + 1] = rr
        partial[3 * b + 2] = rz

    @kernels.func
    def product(
        b: kernels.i32, matrix: Matrix, p: Reals, q: Reals,
        diagonal: Reals, partial: Reals, count: kernels.i32,
    ):  # fmt: skip
        pq = qd.cast(0, real)
        for i in range(row(b, every(blocks, count), count), row(b + 1, every(blocks, count), count)):
            s = add(matrix, i, 0, p, diagonal[i] * p[i])
            q[i] = s
            pq += p[i] * s
        partial[3 * b] = pq

    @kernels.func
    def advance(
        b: kernels.i32, x: Reals, r: Reals, p: Reals, q: Reals, diagonal: Reals, partial: Reals, scalars: Reals,
        count: kernels.i32,
    ):  # fmt: skip
        alpha = scalars[5]
        rr = qd.cast(0, real)
        rz = qd.cast(0, real)
        for i in range(row(b, every(blocks, count), count), row(b + 1, every(blocks, count), count)):
            x[i] = x[i] + alpha * p[i]
            rest = r[i] - alpha * q[i]
            r[i] = rest
            rr += rest * rest
            rz += rest * rest / diagonal[i]
        partial[3 * b + 1] = rr
        partial[3 * b + 2] = rz

    @kernels.func
    def choose(partial: Reals, scalars: Reals):  # type: ignore[no-untyped-def]
        scalars[5] = scalars[2] / total(partial, blocks, 0)

    @kernels.func
    def decide(partial: Reals, scalars: Reals, running: Flag, tolerance: real, largest: kernels.i32):  # type: ignore[no-untyped-def]
        rz = total(partial, blocks, 2)
        scalars[3] = rz / scalars[2]
        scalars[2] = rz
        scalars[1] = total(partial, blocks, 1)
        scalars[4] += 1
        running[None] = qd.cast(scalars[1] > tolerance * tolerance * scalars[0] and scalars[4] < largest, qd.i32)

    @kernels.func
    def turn(b: kernels.i32, r: Reals, p: Reals, diagonal: Reals, scalars: Reals, count: kernels.i32):  # type: ignore[no-untyped-def]
        for i in range(row(b, every(blocks, count), count), row(b + 1, every(blocks, count), count)):
            p[i] = r[i] / diagonal[i] + scalars[3] * p[i]

    @kernels.kernel
    def start_cg(
        matrix: Matrix, x: Reals, r: Reals, p: Reals, q: Reals, diagonal: Reals, rhs: Reals, state: Rows,
        partial: Reals, scalars: Reals, running: Flag, tolerance: real, floor: real, loosest: real, count: kernels.i32,
    ):  # fmt: skip
        qd.loop_config(serialize=serial)
        for b in range(every(blocks, count)):
            residual(b, matrix, x, r, p, diagonal, rhs, state, partial, floor, loosest, count)
        fold(partial, count)
        qd.loop_config(serialize=True)
        for _ in range(1):
            scalars[0] = total(partial, blocks, 0)
            scalars[1] = total(partial, blocks, 1)
            scalars[2] = total(partial, blocks, 2)
            scalars[4] = 0
            running[None] = qd.cast(scalars[1] > tolerance * tolerance * scalars[0], qd.i32)

    @kernels.kernel
    def iterate_in_one_thread(
        matrix: Matrix, x: Reals, r: Reals, p: Reals, q: Reals, diagonal: Reals,
        partial: Reals, scalars: Reals, running: Flag, tolerance: real, largest: kernels.i32, count: kernels.i32,
    ):  # fmt: skip
        qd.loop_config(serialize=True)
        for _ in range(1):
            while running[None] == 1:
                for b in range(blocks):
                    product(b, matrix, p, q, diagonal, partial, count)
                choose(partial, scalars)
                for b in range(blocks):
                    advance(b, x, r, p, q, diagonal, partial, scalars, count)
                decide(partial, scalars, running, tolerance, largest)
                for b in range(blocks):
                    turn(b, r, p, diagonal, scalars, count)

    @kernels.kernel(graph=True)
    def iterate(
        matrix: Matrix, x: Reals, r: Reals, p: Reals, q: Reals, diagonal: Reals,
        partial: Reals, scalars: Reals, running: Flag, tolerance: real, largest: kernels.i32, count: kernels.i32,
    ):  # fmt: skip
        while qd.graph.do_while(running):
            for b in range(every(blocks, count)):
                product(b, matrix, p, q, diagonal, partial, count)
            fold(partial, count)
            for _ in range(1):
                choose(partial, scalars)
            for b in range(every(blocks, count)):
                advance(b, x, r, p, q, diagonal, partial, scalars, count)
            fold(partial, count)
            for _ in range(1):
                decide(partial, scalars, running, tolerance, largest)
            for b in range(every(blocks, count)):
                turn(b, r, p, diagonal, scalars, count)

    return start_cg, iterate_in_one_thread if serial else iterate
