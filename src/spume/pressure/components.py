"""Connected components of the matrix without a known pressure: closed tanks, periodic boxes, pockets.

There the pressure is determined up to a constant, and a solution exists only if the right side sums to
zero: both are projected, component by component. In a tank that is full some row has a low n by chance and is drawn a
little to the pressure of a surface. All of the pressure would hang on it, so ties that are together less than a free
surface says (`FreeSurface.least_tie`) are none.
"""

from typing import Any

from spume import kernels, lanes
from spume.particles import Field, Particles
from spume.pressure.entries import Entries, entry_functions, matrix_type
from spume.pressure.matrix import UNKNOWN, LinearSystem
from spume.reductions import reduction, reduction_arrays

COMPONENT = Field("component", (), "1", "smallest row number of the row's connected component", int)
TIES = Field(
    "ties", (), "1", "sum of what grounds the rows of a component, at its smallest row", int, scratch="components"
)
COMPONENT_FIELDS = (COMPONENT, TIES)


_WORTH_SHARING = 5
"""Threads from which on labels are spread by all of them. One alone carries a label far, row after row; of two, each
begins with labels that the other has not reached, and then follows long chains (5.8 in place of 3.0 ms, 216 000 rows).
Measured with two threads; that five pay is a guess.
"""


class Components:
    """Finds and projects the components of a system that no known pressure ties down."""

    def __init__(self) -> None:
        self._changed = kernels.array(kernels.i32, 1)
        self._floating = kernels.array(kernels.i32, 1)
        self._roots = kernels.array(kernels.i32, 1 + _FEW)
        self._sums: Any = None

    def project(self, system: LinearSystem, particles: Particles, least: int = 1) -> list[int]:
        """Make the right side of each floating component sum to zero; return the components' smallest row numbers.

        What ties a floating component, less than ``least`` in all, is taken off its matrix.
        """
        light = kernels.light(particles.active)
        few = kernels.runtime().device == "cpu" and kernels.runtime().threads < _WORTH_SHARING
        kernel, matrix = _label_kernel(system.entries, light or few), system.matrix(particles)
        state, label = particles[system.state], particles["component"]
        _start_kernel(light)(state, label, particles.active)
        while True:
            self._changed.fill(0)
            kernel(matrix, state, label, particles["ties"], self._changed, particles.active)
            self._floating.fill(0)
            _ground_kernel(light)(
                state, label, particles[system.grounded], particles["ties"], self._floating, least, particles.active
            )
            # Rows of one label are connected, whether or not all of their component have it already.
            if kernels.host(self._floating)[0] == 0:
                return []
            if kernels.host(self._changed)[0] == 0:
                break
        roots = self._floating_roots(system, particles, light, least)
        _release_kernel(light)(
            state, label, particles["ties"], particles["surface_diagonal"], particles["surface_value"],
            particles[system.diagonal], particles[system.rhs], least, particles.active,
        )  # fmt: skip
        self._subtract_means(roots, system.rhs, system.state, particles)
        return roots

    def centre(self, roots: list[int], particles: Particles, state: str = "row_state") -> None:
        """Give the pressure of each floating component, named by its smallest row number, the mean zero."""
        self._subtract_means(roots, "pressure", state, particles)

    def _floating_roots(self, system: LinearSystem, particles: Particles, light: bool, least: int) -> list[int]:
        while True:
            self._roots.fill(0)
            _roots_kernel(light)(
                particles[system.state], particles["component"], particles["ties"], self._roots,
                self._roots.shape[0] - 1, least, particles.active,
            )  # fmt: skip
            found = kernels.host(self._roots)
            number = int(found[0])
            if number < len(found):
                return sorted(int(root) for root in found[1 : 1 + number])
            self._roots = kernels.array(kernels.i32, 1 + 2 * number)

    def _subtract_means(self, roots: list[int], name: str, state: str, particles: Particles) -> None:
        if not roots:
            return
        if self._sums is None:
            self._sums = reduction_arrays(kernels.accumulator(), 2)
        light = kernels.light(particles.active)
        rows = (particles[name], particles[state], particles["component"])
        for root in roots:
            _sum_kernel(light)(*rows, *self._sums, root, particles.active)
            total, number = kernels.host(self._sums[1]).reshape(-1, 2).sum(axis=0)
            _shift_kernel(light)(*rows, float(total / number), root, particles.active)
        particles.written(name)


_FEW = 63
"""Floating components that there is room for at first."""


@kernels.cached
def _start_kernel(serial: bool) -> Any:
    Rows = kernels.array_type(kernels.i32)
    qd = kernels.qd

    @kernels.kernel
    def start_labels(state: Rows, label: Rows, count: kernels.i32):
        qd.loop_config(serialize=serial)
        for i in range(count):
            label[i] = i

    return start_labels


@kernels.cached
def _label_kernel(entries: Entries, serial: bool) -> Any:
    """One round of hooking and pointer jumping: rounds grow with the logarithm of the component's size."""
    Rows, Matrix = kernels.array_type(kernels.i32), matrix_type(entries)
    entry, stride = entry_functions(Matrix, entries), lanes.stride()
    qd = kernels.qd

    @kernels.kernel
    def label_round(matrix: Matrix, state: Rows, label: Rows, ties: Rows, changed: Rows, count: kernels.i32):
        qd.loop_config(serialize=serial)
        for i in range(count):
            if state[i] == UNKNOWN:
                least = label[i]
                first = matrix.start[i]
                chunk = entry.chunk(matrix, i)
                for k in range(matrix.length[i]):
                    least = qd.min(least, label[entry.column(matrix, chunk, first + k * stride)])
                if least < label[i]:
                    qd.atomic_min(label[label[i]], least)
                    qd.atomic_min(label[i], least)
                    changed[0] = 1
        qd.loop_config(serialize=serial)
        for i in range(count):
            root = label[i]
            while label[root] != root:
                root = label[root]
            label[i] = root
            ties[i] = 0

    return label_round


@kernels.cached
def _ground_kernel(serial: bool) -> Any:
    Rows = kernels.array_type(kernels.i32)
    qd = kernels.qd

    @kernels.kernel
    def ground(
        state: Rows, label: Rows, grounded: Rows, ties: Rows, floating: Rows, least: kernels.i32, count: kernels.i32
    ):
        qd.loop_config(serialize=serial)
        for i in range(count):
            # Whether a sum of integers reaches the least depends on no order, and from there on nobody adds.
            if state[i] == UNKNOWN and grounded[i] > 0 and ties[label[i]] < least:
                qd.atomic_add(ties[label[i]], grounded[i])
        qd.loop_config(serialize=serial)
        for i in range(count):
            if state[i] == UNKNOWN and label[i] == i and ties[i] < least:
                qd.atomic_max(floating[0], 1)

    return ground


@kernels.cached
def _roots_kernel(serial: bool) -> Any:
    Rows = kernels.array_type(kernels.i32)
    qd = kernels.qd

    @kernels.kernel
    def roots(
        state: Rows, label: Rows, ties: Rows, found: Rows, room: kernels.i32, least: kernels.i32, count: kernels.i32
    ):
        """List the roots of floating components behind their number, in any order."""
        qd.loop_config(serialize=serial)
        for i in range(count):
            if state[i] == UNKNOWN and label[i] == i and ties[i] < least:
                place = qd.atomic_add(found[0], 1)
                if place < room:
                    found[1 + place] = i

    return roots


@kernels.cached
def _release_kernel(serial: bool) -> Any:
    """Return the kernel that takes what draws the rows of floating components off their equations."""
    Reals, Rows = kernels.array_type(kernels.runtime().real), kernels.array_type(kernels.i32)
    qd = kernels.qd

    @kernels.kernel
    def release(
        state: Rows, label: Rows, ties: Rows, draw: Reals, drawn_to: Reals, diagonal: Reals, rhs: Reals,
        least: kernels.i32, count: kernels.i32,
    ):  # fmt: skip
        qd.loop_config(serialize=serial)
        for i in range(count):
            if state[i] == UNKNOWN and ties[label[i]] < least and diagonal[i] > draw[i]:
                diagonal[i] = diagonal[i] - draw[i]
                rhs[i] = rhs[i] - draw[i] * drawn_to[i]

    return release


@kernels.cached
def _sum_kernel(serial: bool) -> Any:
    """Return the kernel that sums a field over the rows of one component, and counts these."""
    arrays = {"field": kernels.runtime().real, "state": kernels.i32, "label": kernels.i32}
    where = f"state[i] == {UNKNOWN} and label[i] == choice"
    return reduction("component", arrays, ["field[i]", "1"], "0", "{} + {}", where, serial, kernels.accumulator())


@kernels.cached
def _shift_kernel(serial: bool) -> Any:
    real = kernels.runtime().real
    Values, Rows = kernels.array_type(real), kernels.array_type(kernels.i32)
    qd = kernels.qd

    @kernels.kernel
    def shift(field: Values, state: Rows, label: Rows, mean: real, root: kernels.i32, count: kernels.i32):
        qd.loop_config(serialize=serial)
        for i in range(count):
            if state[i] == UNKNOWN and label[i] == root:
                field[i] = field[i] - mean

    return shift
