"""Voids between the rows: what on a grid of cells is empty, connected, and enclosed, followed from step to step.

Each row fills the cells around it by quadratic B-splines, whose sum over the cells is one row's volume wherever it
lies, so the volume of a void, 1 - filled summed over its cells and two around them, changes by what flows in and by
nothing else. The cells are counted in whole numbers, which depend on no order.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume import kernels
from spume.kernels import qd
from spume.particles import ANY, FLUID, Particles

EMPTY = 0.5
"""A cell of which more than this is empty belongs to a void: a film thinner than one row does not close one."""
RING = 2
"""Cells around those of a void that its volume is summed over: farther ones are full."""
_WHOLE = 1 << 20
"""What one row adds to all its cells."""
_MARGIN = RING + 2
_MOST_CELLS = 64
"""Cells for each row at most; where rows fly too far for that, voids are sought between the solid ones alone."""


@dataclass(frozen=True)
class Cells:
    """The voids of one instant, on a grid of cells.

    Attributes:
        first: index of the first cell, floor(x/size), shape (d,).
        size: of a cell [m], shape (d,).
        empty: part of each cell that no row fills [1]; without cells where nothing is or was enclosed.
        label: number of the void that each cell belongs to; 0: none.
        around: number of the enclosed void that each cell belongs to or is near, 0: none; where there are such.
        volumes: of each enclosed void, by its number [m^d].
        sizes: cells of each void, by its number, [0] those of none.
    """

    first: NDArray[np.int64]
    size: NDArray[np.float64]
    empty: NDArray[np.floating[Any]]
    label: NDArray[np.int32]
    around: NDArray[np.int32]
    volumes: dict[int, float]
    sizes: NDArray[np.int64]

    @property
    def cell(self) -> float:
        """Volume of a cell [m^d]."""
        return float(np.prod(self.size))

    def seen_from(self, other: "Cells") -> tuple[tuple[slice, ...], tuple[slice, ...]]:
        """Return the cells that two grids share: as the slices of ``other``, and as those of this one."""
        lower = np.maximum(self.first, other.first)
        upper = np.minimum(self.first + self.label.shape, other.first + other.label.shape)
        upper = np.maximum(lower, upper)
        theirs, own = (
            tuple(slice(int(a), int(b)) for a, b in zip(lower - grid.first, upper - grid.first, strict=True))
            for grid in (other, self)
        )
        return theirs, own


class Voids:
    """Finds the enclosed voids between rows, and shows what is known of each to the rows around it."""

    def __init__(self) -> None:
        self.cells: Cells | None = None
        """Those of the step before, with enclosed voids among them; None: without."""
        self.air: dict[int, tuple[float, float]] = {}
        """Of each enclosed void of the step before, by its number there: what a model keeps of the air in it."""
        self._counts: Any = None
        self._grid: Any = None
        self._values: Any = None
        self._shown = False

    def find(
        self, spacing: float, particles: Particles, periods: Mapping[int, float], least: float = 0.0
    ) -> Cells:  # fmt: skip
        """Return the voids at present.

        Enclosed are those that touch fluid and neither the outside nor, where fluid touches that nowhere (a closed
        tank), are the largest.

        Args:
            spacing: l0 [m].
            particles: rows, whose ``position`` is read.
            periods: length [m] of each periodic axis.
            least: volume [m^d]; voids whose cells have less than half of it are left out.
        """
        filled, water, first, size, row = self._fill(spacing, particles, periods)
        label, number = _connected(filled < (1.0 - EMPTY) / row, periods)
        sizes = np.bincount(label.ravel(), minlength=number + 1)
        enclosed = _enclosed(label, sizes, water > 0, periods) if number > 1 else []
        enclosed = [k for k in enclosed if 2.0 * sizes[k] * np.prod(size) > least]
        around, volumes = label, {}
        empty: NDArray[np.floating[Any]] = np.zeros((0,) * label.ndim)
        if enclosed or self.air:
            empty = 1.0 - row * filled
        if enclosed:
            around = _grown(np.where(np.isin(label, enclosed), label, 0), RING)
            total = np.bincount(around.ravel(), weights=empty.ravel(), minlength=number + 1)
            volumes = {k: float(total[k] * np.prod(size)) for k in enclosed}
        return Cells(first, size, empty, label, around, volumes, sizes)

    def carried(self, now: Cells) -> dict[int, float]:
        """Return the volumes [m^d] to which motion has brought the voids of the step before, by their numbers there.

        Summed over the same cells as then, so that no cell comes or goes: smooth where voids part and join.
        """
        before = self.cells
        if before is None or not self.air:
            return {}
        theirs, own = now.seen_from(before)
        change = -before.empty + 1.0  # where there are no rows any more
        change[theirs] = now.empty[own] - before.empty[theirs]
        grown = np.bincount(before.around.ravel(), weights=change.ravel())
        return {k: volume + float(grown[k]) * before.cell for k, (_, volume) in self.air.items()}

    def parts(self, now: Cells) -> dict[tuple[int, int], float]:
        """Return the volume [m^d] of each void that lies where one of the step before was, by both numbers.

        Of the first number of 0 are voids that are not enclosed; the second is 0 where no known air was. What was full
        of rows says nothing of where the air in it comes from.
        """
        before = self.cells
        present = np.where(np.isin(now.label, list(now.volumes)), now.label, 0)
        former = np.zeros_like(now.label)
        if before is not None:
            theirs, own = now.seen_from(before)
            known = np.where(np.isin(before.label, list(self.air)), before.label, 0)
            former[own] = np.where(before.label > 0, known, -1)[theirs]
        chosen = (now.label > 0) & (former >= 0) & ((present > 0) | (former > 0))
        found, counts = np.unique(np.stack([present[chosen], former[chosen]]), axis=1, return_counts=True)
        seen = dict.fromkeys(now.volumes, 0)
        for k, n in zip(found[0], counts, strict=True):
            if k:
                seen[int(k)] += int(n)
        result = {(k, 0): now.volumes[k] for k, n in seen.items() if n == 0}
        for (k, b), n in zip(found.T, counts, strict=True):
            result[int(k), int(b)] = (now.volumes[int(k)] / seen[int(k)] if k else now.cell) * int(n)
        return result

    def keep(self, now: Cells, air: dict[int, tuple[float, float]]) -> None:
        """Take down the voids for the next step, and of those with air the air and the volume [m^d]."""
        self.cells, self.air = (now, air) if air else (None, {})

    def show(self, values: Mapping[int, float], now: Cells, particles: Particles, out: str, reach: float) -> None:
        """Write to rows the mean value of the voids around them, into the scalar field ``out``; 0 where there are none.

        Args:
            values: of the enclosed voids, by their numbers; of others it is 0.
            now: the voids.
            reach: how far a row looks [cells], at most 2.5.
        """
        if not values and not self._shown:
            return
        self._shown = bool(values)
        table = np.zeros(now.sizes.size)
        for k, value in values.items():
            table[k] = value
        known = np.isin(now.around, list(values))
        weight = np.where(known, np.clip(now.empty, 0.0, 1.0), 0.0)
        n = weight.size
        if self._values is None or self._values[0].shape[0] < n:
            self._values = tuple(kernels.array(kernels.runtime().real, n + n // 2) for _ in range(2))
        for array, numbers in zip(self._values, (weight, table[now.around]), strict=True):
            there = kernels.host(array)
            there[:n] = numbers.ravel()
            kernels.publish(array, there)
        d = particles.dimension
        _show_kernel(d, kernels.light(particles.count))(
            particles["position"], self._grid_of(now.first, now.size, now.label.shape), *self._values, particles[out],
            reach, particles.count,
        )  # fmt: skip
        particles.written(out)

    def state(self) -> dict[str, NDArray[Any]]:
        """Return what the next step reads, empty where nothing is enclosed.

        Arrays of the grid have its shape, ``first`` and ``size`` the shape (d,), ``air`` (voids, 3).
        """
        if self.cells is None:
            return {}
        cells = self.cells
        air = [(k, *pair) for k, pair in self.air.items()]
        return {
            "first": cells.first, "size": cells.size, "empty": cells.empty, "label": cells.label,
            "around": cells.around, "air": np.array(air, dtype=float),
        }  # fmt: skip

    def restore(self, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Take back what `state` gave, arrays of the same shapes."""
        self.cells, self.air = None, {}
        if not arrays:
            return
        grid = {name: np.asarray(arrays[name]) for name in ("first", "size", "empty", "label", "around")}
        self.cells = Cells(**grid, volumes={}, sizes=np.bincount(grid["label"].ravel()))
        self.air = {int(k): (float(a), float(v)) for k, a, v in arrays["air"]}

    def _fill(
        self, spacing: float, particles: Particles, periods: Mapping[int, float]
    ) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int64], NDArray[np.float64], float]:
        """Return what fills each cell, and what fluid does, first index and size of the cells, and what 1 is of one."""
        d, count = particles.dimension, particles.count
        size = _cell_size(spacing, d, periods)
        position = kernels.host(particles["position"])[:count]
        first, shape = _box(position, size, periods)
        if int(np.prod(shape)) > _MOST_CELLS * count + (1 << 16):
            solid = kernels.host(particles["kind"])[:count] != FLUID
            first, shape = _box(position[solid] if solid.any() else position[:1], size, periods)
        n = int(np.prod(shape))
        if self._counts is None or self._counts[0].shape[0] < n:
            self._counts = tuple(kernels.array(kernels.i32, n + n // 2) for _ in range(2))
        _fill_kernel(d, kernels.light(count))(
            particles["position"], particles["kind"], self._grid_of(first, size, tuple(shape)), *self._counts, n, count
        )
        filled, water = (kernels.host(c)[:n].reshape(tuple(shape)) for c in self._counts)
        return filled, water, first, size, float(spacing**d / np.prod(size) / _WHOLE)

    def _grid_of(self, first: NDArray[np.int64], size: NDArray[np.float64], shape: tuple[int, ...]) -> Any:
        """Return the grid as a kernel takes it: size of the cells [m], index of the first, cells along each axis."""
        if self._grid is None:
            self._grid = kernels.array(kernels.runtime().real, 9)
        there = kernels.host(self._grid)
        for k, numbers in enumerate((size, first, shape)):
            there[3 * k : 3 * k + len(shape)] = numbers
        kernels.publish(self._grid, there)
        return self._grid


def enclosed_volumes(
    position: NDArray[np.floating[Any]], kind: NDArray[np.integer[Any]], spacing: float, periods: Mapping[int, float]
) -> list[float]:
    """Return the volumes [m^d] of the voids that rows on a lattice enclose (see `Voids.find`), largest first.

    Args:
        position: of all rows [m], shape (n, d).
        kind: of all rows, shape (n,).
        spacing: l0 [m].
        periods: length [m] of each periodic axis.
    """
    size = _cell_size(spacing, position.shape[1], periods)
    first, shape = _box(position, size, periods)
    if int(np.prod(shape)) > _MOST_CELLS * len(position) + (1 << 16):
        return []
    cells = np.floor(position / size).astype(np.int64) - first
    for axis, number in enumerate(shape):
        cells[:, axis] %= number
    filled, water = np.zeros((2, *shape), dtype=bool)
    filled[tuple(cells.T)] = True
    water[tuple(cells[kind == FLUID].T)] = True
    label, number = _connected(~filled, periods)
    sizes = np.bincount(label.ravel(), minlength=number + 1)
    found = _enclosed(label, sizes, water, periods) if number > 1 else []
    return sorted((float(sizes[k] * np.prod(size)) for k in found), reverse=True)


def _cell_size(spacing: float, d: int, periods: Mapping[int, float]) -> NDArray[np.float64]:
    """Return the size of the cells [m], l0 or as near to it as a period allows, shape (d,)."""
    return np.array([periods[k] / round(periods[k] / spacing) if k in periods else spacing for k in range(d)])


def _box(
    position: NDArray[np.floating[Any]], size: NDArray[np.float64], periods: Mapping[int, float]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return first index and number of cells along each axis of a box around rows, or of the whole period."""
    # Column by column: NumPy's extremes of rows of two or three numbers take thirty times as long.
    ends = np.array([(x.min(), x.max()) for x in position.T]).T / size
    low, high = np.floor(ends).astype(np.int64)
    low, high = low - _MARGIN, high + _MARGIN
    for k, period in periods.items():
        low[k], high[k] = 0, round(period / size[k]) - 1
    return low, high - low + 1


def _connected(void: NDArray[np.bool_], periods: Mapping[int, float]) -> tuple[NDArray[np.int32], int]:
    """Return the numbers of connected cells, from 1 on, and how many there are; periodic axes are closed."""
    from scipy import ndimage
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    label, number = ndimage.label(void)
    for axis in periods:
        one, other = (np.take(label, k, axis=axis).ravel() for k in (0, -1))
        both = (one > 0) & (other > 0)
        pairs = coo_matrix((np.ones(both.sum()), (one[both], other[both])), shape=(number + 1, number + 1))
        _, joined = connected_components(pairs, directed=False)
        # The number 0 of what is filled has no pairs and, being the first, keeps its number.
        label, number = joined[label].astype(np.int32), int(joined.max())
    return label, number


def _enclosed(
    label: NDArray[np.int32], sizes: NDArray[np.int64], water: NDArray[np.bool_], periods: Mapping[int, float]
) -> list[int]:
    """Return the numbers of the voids that are enclosed; see `Voids.find`."""
    for axis in range(water.ndim):
        water = water | np.roll(water, 1, axis=axis) | np.roll(water, -1, axis=axis)
    wet = np.bincount(label[water], minlength=len(sizes)) > 0
    wet[0] = False
    outside = np.zeros(len(sizes), dtype=bool)
    for axis in set(range(label.ndim)) - set(periods):
        for k in (0, -1):
            outside[np.take(label, k, axis=axis)] = True
    inside = wet & ~outside
    if not np.any(wet & outside) and np.any(inside):
        inside[np.argmax(np.where(inside, sizes, 0))] = False
    return [int(k) for k in np.flatnonzero(inside)]


def _grown(label: NDArray[np.int32], cells: int) -> NDArray[np.int32]:
    """Return labels grown by some cells into what has none; where two meet the larger one wins. Ends are joined."""
    for _ in range(cells):
        near = label
        for axis in range(label.ndim):
            near = np.maximum(near, np.maximum(np.roll(near, 1, axis=axis), np.roll(near, -1, axis=axis)))
        label = np.where(label > 0, label, near)
    return label


@kernels.cached
def _fill_kernel(d: int, serial: bool) -> Any:
    """Return the kernel that fills cells with rows, and with fluid, in whole numbers."""
    Vectors, Rows = kernels.array_type(kernels.vector(d)), kernels.array_type(kernels.i32)
    real, static = kernels.runtime().real, kernels.static
    Grid = kernels.array_type(real)

    @kernels.kernel
    def fill(
        position: Vectors, kind: Rows, grid: Grid, filled: Rows, water: Rows, cells: kernels.i32, count: kernels.i32
    ):
        qd.loop_config(serialize=serial)
        for c in range(cells):
            filled[c] = 0
            water[c] = 0
        qd.loop_config(serialize=serial)
        for i in range(count):
            if kind[i] & ANY != 0:
                for o in static(range(3**d)):
                    weight = qd.cast(1.0, real)
                    cell, inside = 0, 1
                    for k in static(range(d)):
                        s = position[i][k] / grid[k] - grid[3 + k]
                        n = qd.cast(grid[6 + k], kernels.i32)
                        middle = qd.cast(qd.floor(s), kernels.i32)
                        t = s - qd.floor(s) - 0.5
                        side = static(o // 3**k % 3 - 1)
                        if static(side == 0):
                            weight *= 0.75 - t * t
                        else:
                            weight *= 0.5 * (0.5 + side * t) ** 2
                        # Beyond the end of a period lies its beginning; around other grids cells are left free.
                        at = middle + side
                        at = qd.select(at < 0, at + n, qd.select(at >= n, at - n, at))
                        if at < 0 or at >= n:
                            inside = 0
                        cell = cell * n + at
                    if inside == 1:
                        part = qd.cast(weight * _WHOLE + 0.5, kernels.i32)
                        qd.atomic_add(filled[cell], part)
                        if kind[i] == FLUID:
                            qd.atomic_add(water[cell], part)

    return fill


@kernels.cached
def _show_kernel(d: int, serial: bool) -> Any:
    """Return the kernel that averages over the cells around each row."""
    real = kernels.runtime().real
    Vectors, Reals = kernels.array_type(kernels.vector(d)), kernels.array_type(real)
    static = kernels.static

    @kernels.kernel
    def show(position: Vectors, grid: Reals, weight: Reals, value: Reals, out: Reals, reach: real, count: kernels.i32):
        qd.loop_config(serialize=serial)
        for i in range(count):
            total, summed = qd.cast(0.0, real), qd.cast(0.0, real)
            for o in range(5**d):
                r2 = qd.cast(0.0, real)
                cell, inside, left = 0, 1, o
                for k in static(range(d)):
                    s = position[i][k] / grid[k] - grid[3 + k]
                    n = qd.cast(grid[6 + k], kernels.i32)
                    at = qd.cast(qd.floor(s), kernels.i32) + left % 5 - 2
                    left //= 5
                    away = qd.cast(at, real) + 0.5 - s
                    r2 += away * away
                    at = qd.select(at < 0, at + n, qd.select(at >= n, at - n, at))
                    if at < 0 or at >= n:
                        inside = 0
                    cell = cell * n + at
                if inside == 1 and r2 < reach * reach:
                    near = (1.0 - r2 / (reach * reach)) ** 2 * weight[cell]
                    total += near
                    summed += near * value[cell]
            out[i] = qd.select(total > 1e-9, summed / qd.max(total, 1e-9), 0.0)

    return show
