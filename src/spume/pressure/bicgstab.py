"""Stabilised bi-conjugate gradients with the diagonal as preconditioner."""

from typing import Any, ClassVar

from spume import kernels, lanes
from spume.particles import Field, Particles
from spume.pressure.base import Solution, Solver, square_of_row
from spume.pressure.conjugate_gradient import BLOCKS, negligible, solution, workspace
from spume.pressure.entries import Entries, matrix_type, row_sum
from spume.pressure.matrix import UNKNOWN, LinearSystem

WIDTH = 5
"""Numbers that each part of a loop sums."""

_VECTORS = ("residual", "shadow", "direction", "product", "middle", "middle_product", "scaled")


class StabilisedBiconjugateGradient(Solver, name="bicgstab"):
    """BiCGSTAB (van der Vorst 1992), preconditioner: the diagonal.

    For matrices that are not symmetric; two products with the matrix per iteration.
    """

    reference: ClassVar = "vandervorst1992"
    symmetric_only: ClassVar = False
    needs: ClassVar = tuple(Field(f"bicgstab_{n}", (), "1", f"{n} vector of BiCGSTAB") for n in _VECTORS)

    def __call__(self, system: LinearSystem, particles: Particles) -> Solution:
        """Solve for the unknown rows of the system."""
        start, iterate = _kernels(system.entries)
        partial, scalars, running = workspace(lanes.room_for_sums(particles.capacity, BLOCKS), WIDTH)
        vectors = [
            particles[system.solution],
            particles[system.diagonal],
            *[particles[f"bicgstab_{n}"] for n in _VECTORS],
        ]
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


@kernels.cached
def _kernels(entries: Entries) -> Any:
    real = kernels.runtime().real
    Matrix = matrix_type(entries)
    Reals, Rows = (kernels.array_type(t) for t in (real, kernels.i32))
    Flag = kernels.qd.types.ndarray(dtype=kernels.i32, ndim=0)
    serial, qd, blocks = kernels.runtime().serial, kernels.qd, BLOCKS

    every, row = lanes.parts_of().every, lanes.parts_of().row
    fold, total = lanes.fold(WIDTH).fold, lanes.fold(WIDTH).total
    add = row_sum(Matrix, entries, "+", real, real)

    @kernels.func
    def row_product(matrix: Matrix, diagonal: Reals, x: Reals, i: kernels.i32):  # type: ignore[no-untyped-def, valid-type]
        return add(matrix, i, 0, x, diagonal[i] * x[i])

    # scalars: 0 b.b, 1 r.r, 2 rho, 3 beta, 4 iterations, 5 omega, 6 alpha
    @kernels.kernel
    def start_bicgstab(
        matrix: Matrix,
        x: Reals, diagonal: Reals, r: Reals, shadow: Reals, p: Reals, v: Reals, s: Reals, t: Reals, y: Reals,
        rhs: Reals, state: Rows, partial: Reals, scalars: Reals, running: Flag, tolerance: real,
        floor: real, loosest: real, count: kernels.i32,
    ):  # fmt: skip
        qd.loop_config(serialize=serial)
        for b in range(every(blocks, count)):
            rr = qd.cast(0, real)
            bb = qd.cast(0, real)
            for i in range(row(b, every(blocks, count), count), row(b + 1, every(blocks, count), count)):
                rest = qd.cast(0, real)
                if state[i] == UNKNOWN:
                    rest = rhs[i] - row_product(matrix, diagonal, x, i)
                    bb += square_of_row(rhs[i], diagonal[i] * x[i], floor, loosest)
                r[i] = rest
                shadow[i] = rest
                p[i] = rest
                v[i] = 0
                rr += rest * rest
            partial[WIDTH * b] = bb
            partial[WIDTH * b + 1] = rr
        fold(partial, count)
        qd.loop_config(serialize=True)
        for _ in range(1):
            scalars[0] = total(partial, blocks, 0)
            scalars[1] = total(partial, blocks, 1)
            scalars[2] = scalars[1]
            scalars[3] = 0
            scalars[4] = 0
            scalars[5] = 1
            running[None] = qd.cast(scalars[1] > tolerance * tolerance * scalars[0], qd.i32)

    @kernels.kernel(graph=True)
    def iterate_bicgstab(
        matrix: Matrix,
        x: Reals, diagonal: Reals, r: Reals, shadow: Reals, p: Reals, v: Reals, s: Reals, t: Reals, y: Reals,
        partial: Reals, scalars: Reals, running: Flag, tolerance: real, largest: kernels.i32, count: kernels.i32,
    ):  # fmt: skip
        while qd.graph.do_while(running):
            # v is still the product of the iteration before; beta is 0 in the first.
            qd.loop_config(serialize=serial)
            for i in range(count):
                p[i] = r[i] + scalars[3] * (p[i] - scalars[5] * v[i])
                y[i] = p[i] / diagonal[i]
            qd.loop_config(serialize=serial)
            for b in range(every(blocks, count)):
                sv = qd.cast(0, real)
                for i in range(row(b, every(blocks, count), count), row(b + 1, every(blocks, count), count)):
                    v[i] = row_product(matrix, diagonal, y, i)
                    sv += shadow[i] * v[i]
                partial[WIDTH * b] = sv
            fold(partial, count)
            qd.loop_config(serialize=True)
            for _ in range(1):
                scalars[6] = scalars[2] / total(partial, blocks, 0)
            qd.loop_config(serialize=serial)
            for b in range(every(blocks, count)):
                alpha = scalars[6]
                for i in range(row(b, every(blocks, count), count), row(b + 1, every(blocks, count), count)):
                    x[i] = x[i] + alpha * y[i]
                    s[i] = r[i] - alpha * v[i]
                    y[i] = s[i] / diagonal[i]
            qd.loop_config(serialize=serial)
            for b in range(every(blocks, count)):
                ts = qd.cast(0, real)
                tt = qd.cast(0, real)
                for i in range(row(b, every(blocks, count), count), row(b + 1, every(blocks, count), count)):
                    t[i] = row_product(matrix, diagonal, y, i)
                    ts += t[i] * s[i]
                    tt += t[i] * t[i]
                partial[WIDTH * b + 1] = ts
                partial[WIDTH * b + 2] = tt
            fold(partial, count)
            qd.loop_config(serialize=True)
            for _ in range(1):
                tt = total(partial, blocks, 2)
                scalars[5] = qd.select(tt > 0, total(partial, blocks, 1) / qd.max(tt, 1e-300), 0.0)
            qd.loop_config(serialize=serial)
            for b in range(every(blocks, count)):
                omega = scalars[5]
                rr = qd.cast(0, real)
                sr = qd.cast(0, real)
                for i in range(row(b, every(blocks, count), count), row(b + 1, every(blocks, count), count)):
                    x[i] = x[i] + omega * y[i]
                    rest = s[i] - omega * t[i]
                    r[i] = rest
                    rr += rest * rest
                    sr += rest * shadow[i]
                partial[WIDTH * b + 3] = sr
                partial[WIDTH * b + 4] = rr
            fold(partial, count)
            qd.loop_config(serialize=True)
            for _ in range(1):
                rho = total(partial, blocks, 3)
                scalars[3] = rho / scalars[2] * scalars[6] / scalars[5]
                scalars[2] = rho
                scalars[1] = total(partial, blocks, 4)
                scalars[4] += 1
                running[None] = qd.cast(
                    scalars[1] > tolerance * tolerance * scalars[0] and scalars[4] < largest, qd.i32
                )

    return start_bicgstab, iterate_bicgstab
