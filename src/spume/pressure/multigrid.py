"""Conjugate gradients with a multigrid preconditioner."""

from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field as Parameter

from spume import kernels, lanes, team
from spume.particles import Particles
from spume.pressure import (
    aggregation,
    coarsest,
    cycle,
    levels,
    team_iteration,
    team_levels,
    wide_iteration,
    wide_levels,
)
from spume.pressure.base import NotConverged, Solution, Solver
from spume.pressure.bicgstab import StabilisedBiconjugateGradient
from spume.pressure.conjugate_gradient import ConjugateGradient, negligible, solution
from spume.pressure.entries import SINGLES
from spume.pressure.matrix import UNKNOWN, LinearSystem

ROOM = (1 / 3, 5.0)
"""Rows of all coarse levels, and their entries, per particle that there is room for at first (it grows)."""


_INNER_ON_DEVICE = 2
"""Levels with inner iterations on wide devices, where each more doubles the launches of all below it, and the graph."""

_ROOM_ON_DEVICE = (1 / 5, 0.0)
_ROOM_OF_ROW = 40
"""Entries of a coarse row that there is room for at first on wide devices, where rows are not packed (it grows)."""

_SINGLES_OF_FINEST = ("diagonal", "inverse", "right", "old", "new")


class Multigrid(Solver, name="multigrid"):
    """Flexible conjugate gradients, preconditioner: one multigrid cycle on background cells.

    Coarse levels are aggregates of rows in cells of 2 l0, 4 l0, … (Södersten, Matsunaga & Koshizuka 2019),
    joined by two inner iterations on each of the finest levels (K-cycle, Notay & Vassilevski 2008). For a
    matrix that is not symmetric, as the system says, conjugate residuals (flexible, truncated after one direction)
    take their place, outside and inside. The number of iterations hardly depends on the number of particles.
    """

    ids: ClassVar = ("A4",)
    reference: ClassVar = "sodersten2019"
    symmetric_only: ClassVar = False
    needs: ClassVar = ConjugateGradient.needs

    patience: int = Parameter(default=100, ge=1)
    """Iterations after which plain conjugate gradients take over [1]."""
    inner_levels: int = Parameter(default=20, ge=0)
    """Coarse levels that may be solved by two inner iterations; the levels below are by one cycle [1]."""

    def __call__(self, system: LinearSystem, particles: Particles) -> Solution:
        """Solve for the unknown rows of ``pressure``.

        A cycle that does not converge in ``patience`` iterations (a matrix that is nearly singular) is given
        up for conjugate gradients (BiCGSTAB where it is not symmetric) with the diagonal, and
        ``Solution.fallbacks`` says so.
        """
        hasty = self.model_copy(update={"largest_iterations": min(self.patience, self.largest_iterations)})
        try:
            return _workspace(particles.dimension).solve(hasty, system, particles)
        except NotConverged:
            value = particles.numpy(system.solution)
            value[particles.numpy(system.state) == UNKNOWN] = 0.0
            particles.set(system.solution, value)
            particles.declare(StabilisedBiconjugateGradient.needs)
            method = ConjugateGradient if system.symmetric else StabilisedBiconjugateGradient
            plain = method(tolerance=self.tolerance, largest_iterations=self.largest_iterations)
            found = plain(system, particles)
            return Solution(found.iterations, found.residual, fallbacks=1)


class _Workspace:
    """Arrays of the coarse levels, which grow as needed and serve every solve."""

    def __init__(self, d: int) -> None:
        self._d = d
        self._real, self._parts = kernels.runtime().real, aggregation.blocks()
        self._capacity = self._rows = self._slots = 0
        self._table = kernels.array(kernels.i32, aggregation.TABLE)
        self._operations = kernels.array(kernels.i32, 8)
        self._program: tuple[int, frozenset[int]] = (-1, frozenset())
        self._length = 0
        self._steps: list[tuple[int, int]] = []
        self._scalars = kernels.array(self._real, cycle.SCALARS + 4 * (aggregation.LEVELS + 1))
        self._partial = kernels.array(self._real, 3)
        self._room_of_row = _ROOM_OF_ROW
        self._low, self._high = (kernels.array(kernels.vector(d), self._parts) for _ in range(2))
        self._running = kernels.scalar_array(kernels.i32)
        self._coarse: Any = None
        self._scratch: Any = None
        self._board = team.board()
        self._host_table: NDArray[np.int32] = np.zeros(aggregation.TABLE, np.int32)

    def solve(self, solver: Multigrid, system: LinearSystem, particles: Particles) -> Solution:
        wide = kernels.runtime().wide
        rows, slots = (int(share * particles.capacity) + 1 for share in (_ROOM_ON_DEVICE if wide else ROOM))
        self._reserve(particles.capacity, rows, slots)
        level = self._finest_level(system, particles)
        diagonal = particles[system.diagonal]
        vectors = [diagonal, *(particles[n] for n in (system.solution, system.rhs, *ConjugateGradient.vectors))]
        self._negligible = negligible(system, solver)
        self._state, self._diagonal, self._entries = particles[system.state], diagonal, system.entries
        alone = aggregation.alone(particles.active)
        build = self._build_in_one_thread if alone else self._build_wide if wide else self._build_in_team
        while True:
            depth, lacking = build(level, particles)
            if lacking == 0:
                break
            if wide and lacking & aggregation.TOO_FEW_SLOTS:
                self._room_of_row *= 2
            self._reserve(
                particles.capacity,
                self._rows * (2 if lacking & aggregation.TOO_FEW_ROWS else 1),
                self._slots * (2 if lacking & aggregation.TOO_FEW_SLOTS else 1),
            )
        # Where densities differ, two levels with inner iterations are too few.
        few = wide and particles.uniform("density")
        self._plan(depth, min(solver.inner_levels, _INNER_ON_DEVICE) if few else solver.inner_levels)
        if alone:
            cycle.solve_in_one_thread(system.symmetric, system.entries)(
                level, self._coarse, self._table, self._operations, self._length, *vectors, self._image, self._partial,
                self._scalars, solver.tolerance, *self._negligible, solver.largest_iterations,
            )  # fmt: skip
        elif wide:
            self._iterate_wide(level, vectors, solver, system)
        else:
            team_iteration.solve_in_team(system.symmetric, system.entries)(
                level, self._coarse, self._table, self._stages, self._number, *vectors, self._image, self._partial,
                self._scalars, self._board, solver.tolerance, *self._negligible, solver.largest_iterations,
            )  # fmt: skip
        return solution(kernels.host(self._scalars), solver)

    def sizes(self) -> list[tuple[int, int]]:
        """Return rows and entries beside the diagonal of each coarse level of the last solve."""
        table, length = self._table.to_numpy(), self._coarse.length.to_numpy()
        found = []
        for k in range(1, int(table[aggregation.DEPTH])):
            at, rows = int(table[2 * k]), int(table[2 * k + 1])
            found.append((rows, int(length[at : at + rows].sum())))
        return found

    def _arguments(self, level: Any, particles: Particles) -> list[Any]:
        return [
            level, self._diagonal, self._coarse, self._scratch, self._table, self._low, self._high,
            particles["position"], self._state, float(aggregation.CELL * particles.spacing), particles.active,
            self._rows, self._slots, self._cells,
        ]  # fmt: skip

    def _build_in_one_thread(self, level: Any, particles: Particles) -> tuple[int, int]:
        """Build the levels; return their number and what there was no room for."""
        levels.build_in_one_thread(self._d, self._entries)(*self._arguments(level, particles))
        return self._outcome()

    def _build_in_team(self, level: Any, particles: Particles) -> tuple[int, int]:
        combined = aggregation.stretches(self._rows)
        build = team_levels.build_in_team(self._d, self._entries)
        build(*self._arguments(level, particles), combined, self._board)
        return self._outcome()

    def _outcome(self) -> tuple[int, int]:
        table = kernels.host(self._table)
        return int(table[aggregation.DEPTH]), int(table[aggregation.OVERFLOW])

    def _build_wide(self, level: Any, particles: Particles) -> tuple[int, int]:
        """Build the levels with a thread for each row."""
        build_first, build_next, eliminate = wide_levels.build_on_device(self._d, self._entries)
        arguments = self._arguments(level, particles)
        build_first(*arguments[:-2], self._room_of_row, arguments[-1])
        table, k = self._table.to_numpy(), 1
        while table[aggregation.DEPTH] == k + 1 and not table[aggregation.OVERFLOW] and k < aggregation.LEVELS:
            if table[2 * k + 1] <= coarsest.MOST_ROWS_OF_ONE_LANE:
                eliminate(self._coarse, self._table, k)
                table = self._table.to_numpy()
                break
            build_next(self._coarse, self._diagonal, self._scratch, self._table, k, self._rows, self._room_of_row)
            table, k = self._table.to_numpy(), k + 1
        self._host_table = table
        return self._outcome()

    def _iterate_wide(self, level: Any, vectors: list[Any], solver: Multigrid, system: LinearSystem) -> None:
        """Iterate with a thread for each row; what is solved directly is one task."""
        diagonal, x, rhs, r, p, q = vectors
        table, n = self._host_table, int(self._host_table[1])
        wide_iteration.start_kernel(system.symmetric, system.entries)(
            level, diagonal, x, rhs, r, p, q, self._partial, self._scalars, self._running, solver.tolerance,
            *self._negligible, n, self._parts,
        )  # fmt: skip
        if int(kernels.host(self._running)) == 0:
            return
        tasks, runs = wide_iteration.tasks_of(self._steps, self._spread_out)
        named = [k for operation, k in tasks if operation != cycle.RUN]
        levels = min(max(named, default=0) + 1, int(table[aggregation.DEPTH]) - 1)
        wide_iteration.iterate_kernel(system.symmetric, system.entries, tasks, levels)(
            level, self._coarse, self._table, self._operations, diagonal, x, r, p, q, self._image, self._partial,
            self._scalars, self._running, solver.tolerance, solver.largest_iterations, self._parts, n,
            *(int(number) for number in table[2 : 2 * (levels + 1)]), *runs,
        )  # fmt: skip

    def _spread_out(self, level: int) -> bool:
        """Return whether many threads work on a coarse level: all but one that is solved directly."""
        table = self._host_table
        return not (level + 1 == int(table[aggregation.DEPTH]) and table[aggregation.BAND] >= 0)

    def _plan(self, depth: int, most: int) -> None:
        inner = cycle.inner_levels(kernels.host(self._table)[3 : 2 * depth : 2].tolist(), most)
        if self._program == (depth, inner):
            return
        self._steps = cycle.program(depth, inner)
        operations = np.array(self._steps, dtype=np.int32).ravel()
        self._length = len(operations) // 2
        self._operations = kernels.array(kernels.i32, max(len(operations), 8))
        padded = np.zeros(self._operations.shape[0], dtype=np.int32)
        padded[: len(operations)] = operations
        self._operations.from_numpy(padded)
        if not kernels.runtime().serial:
            stages = team_iteration.stages_of(self._steps)
            self._stages = kernels.array(kernels.i32, 2 * len(stages))
            self._stages.from_numpy(np.array(stages, np.int32).ravel())
            self._number = len(stages)
        self._program = (depth, inner)

    def _reserve(self, capacity: int, rows: int, slots: int) -> None:
        if kernels.runtime().wide:
            # Each level begins with a new group of rows.
            slots = (max(rows, self._rows) + lanes.GROUP * (aggregation.LEVELS + 1)) * self._room_of_row
        if capacity == self._capacity and rows <= self._rows and slots <= self._slots:
            return
        if capacity != self._capacity:
            self._finest = {n: kernels.array(kernels.f32, capacity) for n in _SINGLES_OF_FINEST}
            self._finest |= {n: kernels.array(kernels.i32, capacity) for n in ("row", "aggregate", "member")}
            self._image = kernels.array(self._real, capacity)
            self._partial = kernels.array(self._real, 3 * lanes.room_for_sums(capacity, self._parts))
        self._capacity, self._rows, self._slots = capacity, max(rows, self._rows), max(slots, self._slots)
        self._cells = capacity + (1 << 16)
        self._coarse = self._scratch = None  # there may be no room for the old ones beside the new
        integers = ("row", "start", "length", "aggregate", "member", "first", "last", "cell")
        singles = ("diagonal", "excess", "inverse", "right", "old", "new", "image", "kept")
        self._coarse = aggregation.level_type(SINGLES)(
            column=kernels.array(kernels.i32, self._slots),
            value=kernels.array(kernels.f32, self._slots),
            **{n: kernels.array(kernels.i32, self._rows) for n in integers},
            **{n: kernels.array(kernels.f32, self._rows) for n in singles},
            band=kernels.array(self._real, coarsest.room()),
        )
        self._scratch = aggregation.scratch_type()(
            **{n: kernels.array(kernels.i32, self._cells + 2) for n in ("begin", "cursor", "base")},
            **{n: kernels.array(kernels.i32, capacity) for n in ("order", "label")},
            marker=kernels.array(kernels.i32, max(aggregation.stretches(self._rows) * self._rows, 1)),
            sums=kernels.array(kernels.i32, lanes.room_for_scan(max(self._cells + 2, self._parts))),
            counts=kernels.array(kernels.i32, self._parts),
        )

    def _finest_level(self, system: LinearSystem, particles: Particles) -> Any:
        mine = self._finest
        unused, no_rows = mine["new"], mine["member"]
        return aggregation.level_type(system.entries)(
            **mine, **system.members(particles), first=no_rows, last=no_rows, cell=no_rows, excess=unused, image=unused,
            kept=unused, band=self._image,
        )  # fmt: skip


def coarse_levels(d: int) -> list[tuple[int, int]]:
    """Return rows and entries beside the diagonal of each coarse level of the last solve in d dimensions."""
    found: list[tuple[int, int]] = _workspace(d).sizes()
    return found


@kernels.cached
def _workspace(d: int) -> _Workspace:
    return _Workspace(d)
