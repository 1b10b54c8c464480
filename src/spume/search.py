"""Neighbour search: rows sorted by cell, then a list of near rows for each fluid and wall row.

A counting sort brings the rows into cell order (x fastest; within a cell by id, so that the order
does not depend on threads). Neighbouring cells along x are then one contiguous range of rows, and the
search walks 3 (2D) or 9 (3D) such ranges per row (``ranges.py``). Lists are written in one pass: a block of
rows shares a stretch of storage, inside which its lists are packed; the stretch grows when it overflows.
Blocks lie in as many arrays as they need (``chunks.py``).

Solid rows that no fluid is near come last in the table, sorted alike: the loops of a step end before them
(``Particles.active``), so the walls of a large empty tank cost next to nothing.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume import chunks, kernels, lanes
from spume.lattice import regular_neighbours
from spume.particles import FLUID, Particles
from spume.ranges import CELLS_PER_REACH, list_kernel
from spume.reductions import reduction, reduction_arrays

_WET_REACHES = 2
"""A solid row is dry, and takes no part, if no fluid lies within this many search radii of it, counted in cells.

A wall row that sees fluid (one radius) has neighbours (another) that must be there for its own sums.
"""

_WORTH = 3
"""Updates that a list with a skin must serve, at the speed since the last build, for the skin to be used."""

_MORE_CELLS = 1.25
"""Cells that there is room for once there is too little, as a multiple of those that are needed."""

_CROWDED = 20
"""Lists that are this many times longer than on the regular arrangement are those of rows that fell together."""


class TooManyNeighbours(RuntimeError):
    """The rows lie so close that no list of neighbours holds them."""


class NeighbourList:
    """Rows near each row, stored as 64-bit starts, lengths and row numbers.

    Attributes:
        start: first slot of each row's list in its chunk (int64).
        length: number of neighbours of each row (int32).
        fluid: how many of a row's neighbours are fluid: those come first in its list.
        chunks: the rows as they were cut at the last build, with their neighbours.
        builds: how many times the list was built.
        current_skin: skin of the present list [m]: ``skin`` in calm flow, 0 where rows move too fast for it.
    """

    def __init__(
        self,
        radius: float,
        skin: float,
        lower: NDArray[np.float64],
        upper: NDArray[np.float64],
        periodic: tuple[bool, ...],
    ) -> None:
        self.radius = radius
        self.skin = skin
        self.lower, self.upper = lower, upper
        self.periodic = periodic
        self.period = tuple(float(p) for p in np.where(periodic, upper - lower, 1.0))
        for k, joined in enumerate(periodic):
            if joined and self.period[k] < 3 * (radius + skin):
                raise ValueError(
                    f"periodic length {self.period[k]:g} m along axis {k}: at least three times the search "
                    f"radius, {3 * (radius + skin):g} m"
                )
        self.builds = 0
        self.chunks: list[chunks.Chunk] = []
        self.current_skin = skin
        self._updates = 0
        self._home: tuple[NDArray[np.float64], NDArray[np.float64]] | None = None
        self._cells_built: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]] | None = None
        self._capacity = 0
        self._cells = 0
        self._storage = chunks.Storage()
        d = len(lower)
        self._partial = kernels.array(kernels.vector(d), 2 * lanes.reduction_blocks())
        self._moved = reduction_arrays(kernels.runtime().real)
        self._bounds = kernels.array(kernels.vector(d), 2 * lanes.REDUCED)
        self._flag = kernels.array(kernels.i32, 1)

    def update(self, particles: Particles) -> int:
        """Make the list valid for the present positions; return how many rows left the region."""
        if self.builds and not particles.changed and self.skin > 0:
            self._updates += 1
            moved = math.sqrt(self._largest_displacement_squared(particles))
            if moved < 0.5 * self.current_skin:
                return 0
            # A skin makes every sum longer; it pays only if the list then serves several updates.
            self.current_skin = self.skin if 0.5 * self.skin * self._updates >= _WORTH * moved else 0.0
        return self.build(particles)

    def build(self, particles: Particles) -> int:
        """Sort the rows by cell and build the list; return how many rows were removed.

        Raises:
            TooManyNeighbours: rows fell together, so that their lists would not fit.
        """
        self._reserve(particles)
        low, high = self._wrap_and_bound(particles)
        removed = 0
        if not (np.all(self._within(low)) and np.all(self._within(high))):
            removed = particles.remove(~np.all(self._within(particles.numpy("position")), axis=1))
            low, high = self._wrap_and_bound(particles)
        if particles.count == 0:
            low = high = self.lower
        self._cells_built = self._grid(particles.count, low, high)
        self._sort_and_list(particles)
        self._updates = 0
        self.builds += 1
        return removed

    def _within(self, x: NDArray[np.floating]) -> NDArray[np.bool_]:
        """Return which coordinates lie in the region.

        Those along a periodic axis have been brought there, up to rounding, unless they are no numbers.
        """
        beyond = np.where(self.periodic, 0.5 * (self.upper - self.lower), 0.0)
        return np.asarray((x >= self.lower - beyond) & (x <= self.upper + beyond))

    def state(self, particles: Particles) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Return numbers and arrays, shape (rows,) or (rows, d), from which `restore` makes this list again."""
        numbers: dict[str, Any] = {
            "lower": self.lower.tolist(),
            "upper": self.upper.tolist(),
            "builds": self.builds,
            "updates": self._updates,
            "current_skin": self.current_skin,
            "home": None if self._home is None else [corner.tolist() for corner in self._home],
            "cells": None,
        }
        # Without a skin, and where rows came or went, the next update builds the list from scratch anyway.
        if not self.builds or self.skin == 0 or particles.changed or self._cells_built is None:
            return numbers, {}
        numbers["cells"] = [values.tolist() for values in self._cells_built]
        return numbers, {"built": np.array(kernels.host(self._built)[: particles.count])}

    def restore(self, particles: Particles, numbers: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> None:
        """Make the list of `state` again, from arrays of its shapes: the positions and cells of its last build."""
        self.lower, self.upper = np.array(numbers["lower"]), np.array(numbers["upper"])
        self.builds, self._updates = int(numbers["builds"]), int(numbers["updates"])
        self.current_skin = float(numbers["current_skin"])
        home = numbers["home"]
        dtype = kernels.runtime().dtype  # rounded otherwise, sums with positions would be others
        self._home = None if home is None else (np.array(home[0], dtype), np.array(home[1], dtype))
        particles.changed = True
        if numbers["cells"] is None:
            return
        origin, size, shape = numbers["cells"]
        self._cells_built = np.array(origin), np.array(size), np.array(shape, dtype=np.int64)
        present = particles.numpy("position")
        particles.set("position", arrays["built"])
        self._reserve(particles)
        self._sort_and_list(particles)  # the rows are in this order already: by cell, then by id
        particles.set("position", present)

    def _sort_and_list(self, particles: Particles) -> None:
        assert self._cells_built is not None
        self._sort(particles, *self._cells_built)
        self._cut(particles.active)
        while not self._fill(particles, *self._cells_built):
            used = int(kernels.host(self._flag)[0])
            slots = int(1.06 * used) + 16
            if used > _CROWDED * self._regular_slots(particles) or slots > chunks.MOST_ENTRIES:
                block = self._storage.rows_per_block
                raise TooManyNeighbours(
                    f"{used / block:.0f} neighbours a row, where the regular arrangement has "
                    f"{self._regular_slots(particles) / block:.0f}"
                )
            self._storage.slots_per_block = slots
            self._cut(particles.active)
        if self.skin > 0:
            kernel = _copy_kernel(particles.dimension, kernels.light(particles.count))
            kernel(particles["position"], self._built, particles.count)
        particles.changed = False
        # Positions and kinds are read, starts, lengths and the neighbours themselves written.
        particles.traffic += particles.count * (12 + particles.row_bytes(("position", "kind")))
        particles.visits += 1

    def entries(self, particles: Particles) -> int:
        """Return the neighbours of all active rows together."""
        return int(np.sum(kernels.host(self.length)[: particles.active], dtype=np.int64))

    def _regular_slots(self, particles: Particles) -> float:
        """Return the neighbours that a block of rows has on the regular arrangement."""
        reach = (self.radius + self.skin) / particles.spacing
        return regular_neighbours(reach, particles.dimension) * self._storage.rows_per_block

    def bytes(self) -> int:
        """Return the memory of the list [bytes]."""
        return 16 * self._capacity + 4 * self._storage.slots

    def _reserve(self, particles: Particles) -> None:
        if self._capacity == particles.capacity:
            return
        self._capacity = particles.capacity
        self.start = kernels.array(kernels.i64, self._capacity)
        self.length = kernels.array(kernels.i32, self._capacity)
        self.fluid = kernels.array(kernels.i32, self._capacity)
        self._cell = kernels.array(kernels.i32, self._capacity)
        self._order = kernels.array(kernels.i32, self._capacity)
        self._built = kernels.array(kernels.vector(particles.dimension), self._capacity)
        if not self._storage.slots_per_block:
            # On wide devices a row has as many slots as the one with the most neighbours needs.
            share = 1.05 if kernels.runtime().wide else 0.9
            self._storage.slots_per_block = int(share * self._regular_slots(particles)) + 64
        self._storage.blocks = 0

    def _cut(self, rows: int) -> None:
        self.chunks = []  # or they would keep arrays alive that give way to larger ones
        self.chunks = self._storage.cut(rows)

    def _wrap_and_bound(self, particles: Particles) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        d = particles.dimension
        kernel = _wrap_and_bound_kernel(d, self.periodic, kernels.light(particles.count))
        kernel(
            particles["position"], self._partial, self._bounds, particles.count, *map(float, self.lower), *self.period
        )
        bounds = kernels.host(self._bounds)
        return bounds[: lanes.REDUCED].min(axis=0), bounds[lanes.REDUCED :].max(axis=0)

    def _largest_displacement_squared(self, particles: Particles) -> float:
        kernel = _displacement_kernel(particles.dimension, kernels.light(particles.count))
        kernel(particles["position"], self._built, *self._moved, 0, particles.count)
        return float(kernels.host(self._moved[1]).max())

    def _grid(
        self, count: int, low: NDArray[np.float64], high: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
        """Choose the cells: the rows' bounding box, of which only rows that fly far are left out.

        A row outside the grid is counted into the nearest border cell. That keeps the search exact
        (clamping never moves two rows apart) and its cost bounded.
        """
        if self._home is None:
            extent = high - low + self.radius
            self._home = low - 0.5 * extent, high + 0.5 * extent
        low, high = np.maximum(low, self._home[0]), np.minimum(high, self._home[1])
        low, high = np.minimum(low, high), np.maximum(low, high)
        joined = np.array(self.periodic)
        low = np.where(joined, self.lower, low)
        extent = np.where(joined, self.upper - self.lower, high - low)
        size = (self.radius + self.current_skin) / np.array(CELLS_PER_REACH[: len(low)])
        while True:
            shape = np.where(joined, np.floor(extent / size), np.floor(extent / size) + 1).astype(np.int64)
            shape = np.maximum(shape, np.where(joined, 3, 1))
            if shape.prod() <= min(max(4 * count, 1 << 16), kernels.LONGEST_ARRAY // 4 - 1):
                break
            size = size * 1.5
        return low, np.where(joined, extent / shape, size), shape

    def _sort(
        self,
        particles: Particles,
        origin: NDArray[np.float64],
        size: NDArray[np.float64],
        shape: NDArray[np.int64],
    ) -> None:
        d, count, cells = particles.dimension, particles.count, int(shape.prod())
        if 2 * cells + 1 > self._cells:
            self._cells = min(int(_MORE_CELLS * (2 * cells + 1)), kernels.LONGEST_ARRAY)
            self._near = kernels.array(kernels.i32, self._cells)
            self._cell_start = kernels.array(kernels.i32, self._cells)
            self._cursor = kernels.array(kernels.i32, self._cells)
            self._sums = kernels.array(kernels.i32, lanes.room_for_scan(self._cells))
        light = kernels.light(count)
        _cell_kernel(d, self.periodic, light)(
            particles["position"], particles["kind"], self._cell, self._order, self._cursor, self._near, count, cells,
            *map(float, origin), *map(float, size), *[int(s) for s in shape],
        )  # fmt: skip
        _scan_kernel(light)(self._cursor, self._cell_start, self._sums, 2 * cells)
        _scatter_kernel(light)(
            self._cell, self._cell_start, self._cursor, self._order, particles["id"], self._flag, count, 2 * cells
        )
        if last := int(kernels.host(self._flag)[0]):
            particles.reorder(self._order, last)
        particles.part(int(kernels.value(self._cell_start, cells)))

    def _fill(
        self,
        particles: Particles,
        origin: NDArray[np.float64],
        size: NDArray[np.float64],
        shape: NDArray[np.int64],
    ) -> bool:
        kernel, storage = list_kernel(particles.dimension, self.periodic), self._storage
        self._flag.fill(0)
        for chunk in self.chunks:
            kernel(
                particles["position"], particles["kind"], self._cell_start, self.start, self.length, self.fluid,
                chunk.neighbour, self._flag, chunk.begin, chunk.end, storage.rows_per_block, storage.slots_per_block,
                self.radius + self.current_skin,
                *map(float, origin), *map(float, size), *[int(s) for s in shape], *self.period,
            )  # fmt: skip
        return int(kernels.host(self._flag)[0]) <= storage.slots_per_block


def _types(d: int) -> tuple[Any, Any, Any, Any]:
    return (
        kernels.array_type(kernels.vector(d)),
        kernels.array_type(kernels.i32),
        kernels.array_type(kernels.i64),
        kernels.runtime().real,
    )


@kernels.cached
def _copy_kernel(d: int, serial: bool) -> Any:
    (Vectors, _, _, _), qd = _types(d), kernels.qd

    @kernels.kernel
    def copy(source: Vectors, target: Vectors, count: kernels.i32):
        qd.loop_config(serialize=serial)
        for i in range(count):
            target[i] = source[i]

    return copy


@kernels.cached
def _displacement_kernel(d: int, serial: bool) -> Any:
    """Return the kernel that finds the square of the largest displacement since the list was built."""
    # A position that is not a number must cause a build, which removes it.
    square = "no_nan((position[i] - built[i]).dot(position[i] - built[i]))"
    arrays = {"position": kernels.vector(d), "built": kernels.vector(d)}
    return reduction("displacement", arrays, [square], "0", "qd.max({}, {})", "True", serial)


@kernels.cached
def _wrap_and_bound_kernel(d: int, periodic: tuple[bool, ...], serial: bool) -> Any:
    lower = ", ".join(f"lower{k}: real" for k in range(d))
    period = ", ".join(f"period{k}: real" for k in range(d))
    # Less than an ulp below the lower end, a coordinate would come to lie on the upper one.
    wraps = [
        f"                position[i][{k}] {change}"
        for k in range(d)
        for change in (
            f"-= period{k} * qd.floor((position[i][{k}] - lower{k}) / period{k})",
            f"= qd.select(position[i][{k}] >= lower{k} + period{k}, lower{k}, position[i][{k}])",
        )
        if periodic[k]
    ]
    Vectors, _, _, real = _types(d)
    blocks = lanes.reduction_blocks()
    lines = [
        f"def wrap_and_bound(position: Vectors, partial: Vectors, found: Vectors, count: qd.i32, {lower}, {period}):",
        "    qd.loop_config(serialize=serial)",
        "    for t in range(blocks * spread):",
        "        if t % spread == 0:",
        "            b = t // spread",
        "            low = Vector(largest)",
        "            high = Vector(-largest)",
        "            for i in range(qd.cast(qd.cast(count, qd.i64) * b // blocks, qd.i32),",
        "                           qd.cast(qd.cast(count, qd.i64) * (b + 1) // blocks, qd.i32)):",
        *wraps,
        "                x = position[i]",
        # Comparisons with NaN are false, so a NaN position leaves no trace in min and max: flag it.
        "                for k in qd.static(range(d)):",
        "                    if not (qd.abs(x[k]) < largest):",
        "                        x[k] = largest",
        "                low = qd.min(low, x)",
        "                high = qd.max(high, x)",
        "            partial[b] = low",
        "            partial[blocks + b] = high",
        "    qd.loop_config(serialize=few)",
        "    for c in range(reduced):",
        "        low = Vector(largest)",
        "        high = Vector(-largest)",
        "        for k in range(share):",
        "            low = qd.min(low, partial[c + k * reduced])",
        "            high = qd.max(high, partial[blocks + c + k * reduced])",
        "        found[c] = low",
        "        found[reduced + c] = high",
    ]
    return kernels.compiled(
        "wrap_and_bound", "\n".join(lines) + "\n", Vectors=Vectors, real=real, d=d,
        Vector=kernels.vector(d), blocks=blocks, serial=serial, few=not kernels.runtime().wide, reduced=lanes.REDUCED,
        spread=1 if serial else kernels.spread(blocks), share=blocks // lanes.REDUCED,
        largest=float(np.finfo(kernels.runtime().dtype).max),
    )  # fmt: skip


@kernels.cached
def _cell_kernel(d: int, periodic: tuple[bool, ...], serial: bool) -> Any:
    """Generate the count of rows per cell; dry rows are counted in a second set of cells behind the first.

    Wet and dry are told apart on a grid of blocks of cells: a solid row is wet if there is fluid in its block or
    in one beside it.
    """
    Vectors, Rows, _, real = _types(d)
    axes = range(d)
    w = [_WET_REACHES * cells for cells in CELLS_PER_REACH]
    parameters = [f"origin{k}: real" for k in axes] + [f"size{k}: real" for k in axes]
    parameters += [f"shape{k}: qd.i32" for k in axes]
    index = [
        f"        c{k} = qd.min(qd.max(qd.cast(qd.floor((position[i][{k}] - origin{k}) / size{k}), qd.i32), 0), "
        f"shape{k} - 1)"
        for k in axes
    ]
    flat = "c0 + shape0 * c1" if d == 2 else "c0 + shape0 * (c1 + shape1 * c2)"
    block, beside = (
        f"{n}0 + blocks0 * {n}1" if d == 2 else f"{n}0 + blocks0 * ({n}1 + blocks1 * {n}2)" for n in ("b", "n")
    )
    # A last block that is not full leaves its neighbour too near: it is joined to the one before.
    blocks = [f"    blocks{k} = qd.max(shape{k} // {w[k]}, 1)" for k in axes]
    of_row = [f"        b{k} = qd.min(c{k} // {w[k]}, blocks{k} - 1)" for k in axes]
    walk, indent = [], "        "
    for k in reversed(axes):
        walk.append(f"{indent}for o{k} in range(-1, 2):")
        indent += "    "
        if periodic[k]:
            walk.append(f"{indent}n{k} = (b{k} + o{k} + blocks{k}) % blocks{k}")
        else:
            walk.append(f"{indent}n{k} = qd.min(qd.max(b{k} + o{k}, 0), blocks{k} - 1)")
    lines = [
        "def cells(position: Vectors, kind: Rows, cell: Rows, block_of: Rows, counts: Rows, fluid: Rows,",
        f"          count: qd.i32, cells: qd.i32, {', '.join(parameters)}):",
        *blocks,
        "    qd.loop_config(serialize=serial)",
        "    for c in range(2 * cells + 1):",
        "        counts[c] = 0",
        "        fluid[c] = 0",
        "    qd.loop_config(serialize=serial)",
        "    for i in range(count):",
        *index,
        *of_row,
        f"        cell[i] = {flat}",
        f"        block_of[i] = {block}",
        f"        if kind[i] & {FLUID} != 0:",
        "            fluid[block_of[i]] = 1",
        "    qd.loop_config(serialize=serial)",
        f"    for q in range({' * '.join(f'blocks{k}' for k in axes)}):",
        *[f"        b{k} = q // ({' * '.join(['1', *[f'blocks{m}' for m in range(k)]])}) % blocks{k}" for k in axes],
        "        wet = 0",
        *walk,
        f"{indent}wet |= fluid[{beside}]",
        "        fluid[cells + q] = wet",
        "    qd.loop_config(serialize=serial)",
        "    for i in range(count):",
        f"        if kind[i] & {FLUID} == 0:",
        "            if fluid[cells + block_of[i]] == 0:",
        "                cell[i] += cells",
        "        counts[cell[i]] += 1",
    ]
    return kernels.compiled("cells", "\n".join(lines) + "\n", Vectors=Vectors, Rows=Rows, real=real, serial=serial)


@kernels.cached
def _scan_kernel(serial: bool) -> Any:
    _, Rows, _, _ = _types(2)
    exclusive_sums = lanes.exclusive_sums(serial)

    @kernels.kernel
    def scan(counts: Rows, start: Rows, sums: Rows, n: kernels.i32):
        """Exclusive sums of n counts, and their total behind the last."""
        exclusive_sums(counts, start, sums, n)

    return scan


@kernels.cached
def _scatter_kernel(serial: bool) -> Any:
    (_, Rows, _, _), qd = _types(2), kernels.qd

    @kernels.kernel
    def scatter(
        cell: Rows, start: Rows, cursor: Rows, order: Rows, ids: Rows, changed: Rows, count: kernels.i32,
        cells: kernels.i32,
    ):  # fmt: skip
        changed[0] = 0
        qd.loop_config(serialize=serial)
        for i in range(count):
            slot = qd.atomic_add(cursor[cell[i]], 1)
            order[slot] = i
        # Within a cell by id: the order must not depend on which thread came first.
        qd.loop_config(serialize=serial)
        for c in range(cells):
            for s in range(start[c] + 1, start[c + 1]):
                row = order[s]
                key = ids[row]
                t = s - 1
                while t >= start[c] and ids[order[qd.max(t, 0)]] > key:
                    order[t + 1] = order[t]
                    t -= 1
                order[t + 1] = row
        qd.loop_config(serialize=serial)
        for i in range(count):
            # An atomic operation of each row on one number would be a queue.
            if order[i] != i and changed[0] <= i:
                qd.atomic_max(changed[0], i + 1)

    return scatter
