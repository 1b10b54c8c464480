"""Which rows are near some that a field marks."""

from typing import Any

from spume import kernels, lanes
from spume.pairs import Pairs
from spume.particles import FLUID, Particles


def pair_mark(where: str, particles: Particles, pairs: Pairs, *, out: str) -> None:
    """Write 1 to the scalar field ``out`` of fluid rows where the field ``where`` is positive, and of their neighbours.

    Other rows keep what they have. A sum to which only such rows contribute can leave out all rows without one near.
    """
    list_ = pairs.list
    for chunk in list_.chunks:
        _mark_kernel()(
            particles["kind"], list_.start, list_.length, chunk.neighbour, particles[where], particles[out],
            chunk.begin, chunk.end,
        )  # fmt: skip
    particles.written(out)
    particles.traffic += particles.active * particles.row_bytes(("kind", where, out))


@kernels.cached
def _mark_kernel() -> Any:
    """Return the loop that marks neighbours: threads that mark the same row write the same number."""
    Reals, Rows = kernels.array_type(kernels.runtime().real), kernels.array_type(kernels.i32)
    Starts = kernels.array_type(kernels.i64)
    qd, serial, stride = kernels.qd, kernels.runtime().serial, lanes.stride()

    @kernels.kernel
    def mark(
        kind: Rows, start: Starts, length: Rows, neighbour: Rows, where: Reals, out: Reals,
        begin: kernels.i32, end: kernels.i32,
    ):  # fmt: skip
        qd.loop_config(serialize=serial)
        for i in range(begin, end):
            if kind[i] & FLUID != 0 and where[i] > 0:
                out[i] = 1.0
                first = qd.cast(start[i], qd.i32)
                for k in range(length[i]):
                    out[neighbour[first + k * stride]] = 1.0

    return mark
