"""Connected components of the matrix without a known pressure: closed tanks, periodic boxes, pockets.

There the pressure is determined up to a constant, and a solution exists only if the right side sums to
zero: both are projected, component by component.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume import kernels, lanes
from spume.particles import Field, Particles
from spume.pressure.entries import Entries, entry_functions, matrix_type
from spume.pressure.matrix import UNKNOWN, LinearSystem

COMPONENT = Field("component", (), "1", "smallest row number of the row's connected component", int)


class Components:
    """Finds and projects the components of a system that no known pressure ties down."""

    def __init__(self) -> None:
        self._changed = kernels.array(kernels.i32, 1)
        self._floating = kernels.array(kernels.i32, 1)

    def project(self, system: LinearSystem, particles: Particles) -> list[NDArray[np.intp]]:
        """Make the right side of each floating component sum to zero; return the components' rows, shape (rows,)."""
        light = kernels.light(particles.active)
        kernel, matrix = _label_kernel(system.entries, light), system.matrix(particles)
        state, label = particles[system.state], particles["component"]
        _start_kernel(light)(state, label, particles.active)
        while True:
            self._changed.fill(0)
            kernel(matrix, state, label, particles[system.grounded], self._changed, particles.active)
            self._floating.fill(0)
            _ground_kernel(light)(state, label, particles[system.grounded], self._floating, particles.active)
            # Rows of one label are connected, whether or not all of their component have it already.
            if kernels.host(self._floating)[0] == 0:
                return []
            if kernels.host(self._changed)[0] == 0:
                break
        labels, tied = particles.numpy("component"), particles.numpy(system.grounded)
        unknown = particles.numpy(system.state) == UNKNOWN
        rhs = particles.numpy(system.rhs)
        found = []
        for root in np.unique(labels[unknown & (tied[labels] == 0)]):
            rows = np.flatnonzero(unknown & (labels == root))
            rhs[rows] -= rhs[rows].mean()
            found.append(rows)
        particles.set(system.rhs, rhs)
        return found

    @staticmethod
    def centre(components: list[NDArray[np.intp]], particles: Particles) -> None:
        """Give the pressure of each floating component, its rows of shape (rows,), the mean zero."""
        if not components:
            return
        pressure = particles.numpy("pressure")
        for rows in components:
            pressure[rows] -= pressure[rows].mean()
        particles.set("pressure", pressure)


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
    def label_round(matrix: Matrix, state: Rows, label: Rows, grounded: Rows, changed: Rows, count: kernels.i32):
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

    return label_round


@kernels.cached
def _ground_kernel(serial: bool) -> Any:
    Rows = kernels.array_type(kernels.i32)
    qd = kernels.qd

    @kernels.kernel
    def ground(state: Rows, label: Rows, grounded: Rows, floating: Rows, count: kernels.i32):
        qd.loop_config(serialize=serial)
        for i in range(count):
            if state[i] == UNKNOWN and grounded[i] == 1:
                qd.atomic_max(grounded[label[i]], 1)
        qd.loop_config(serialize=serial)
        for i in range(count):
            if state[i] == UNKNOWN and label[i] == i and grounded[i] == 0:
                qd.atomic_max(floating[0], 1)

    return ground
