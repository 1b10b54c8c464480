"""The lists of near rows, written from rows in cell order.

Cells are narrow along x, where rows of neighbouring cells follow each other in the table, and as wide as the search
radius across it. A row's neighbours lie in 3 (2D) or 9 (3D) rows of cells; of each it looks through the range that the
sphere around it leaves, half of what whole cells of the search radius would hold.
"""

from typing import Any

import numpy as np

from spume import kernels, lanes
from spume.particles import FLUID, WALL

LISTED = FLUID | WALL
"""Kinds of rows that own a list; dummy rows appear only as neighbours."""

CELLS_PER_REACH = (4, 1, 1)
"""Cells are this many times smaller than the search radius along each axis."""

_MARGIN = 0.01
"""Part of a cell by which a range along x is longer than it need be, for rounding."""

_MANY_BLOCKS = 512


@kernels.cached
def list_kernel(d: int, periodic: tuple[bool, ...]) -> Any:
    """Generate the kernel that writes the lists from rows in cell order."""
    axes, spread, real = range(d), kernels.spread(_MANY_BLOCKS), kernels.runtime().real
    parameters = [f"origin{k}: real" for k in axes] + [f"size{k}: real" for k in axes]
    parameters += [f"shape{k}: qd.i32" for k in axes] + [f"period{k}: real" for k in axes]
    ranges = 3 ** (d - 1) * (2 if periodic[0] else 1)
    wide = kernels.runtime().wide
    times = f" * {lanes.stride()}" if wide else ""
    row_of_cells = "shape0 * n1" if d == 2 else "shape0 * (n1 + shape1 * n2)"
    body = [
        f"c{k} = qd.min(qd.max(qd.cast(qd.floor((x[{k}] - origin{k}) / size{k}), qd.i32), 0), shape{k} - 1)"
        for k in range(1, d)
    ]
    body += ["low = Ranges(0)", "high = Ranges(0)", "found = 0", *(["solid = 0"] if wide else [])]
    # All ranges are found before any is walked: the ends of short loops are never foreseen, what follows then waits.
    for offsets in np.ndindex(*(3,) * (d - 1)):
        body.append("square = reach * reach")
        inside = []
        for k, offset in enumerate(reversed(offsets), 1):
            m = f"(c{k} + {offset - 1})"
            body.append(f"n{k} = {f'({m} + shape{k}) % shape{k}' if periodic[k] else m}")
            if not periodic[k]:
                inside.append(f"n{k} >= 0 and n{k} < shape{k}")
            # How far the nearest face of those cells is; rows outside the grid lie behind the cells that count them.
            if offset != 1:
                face = f"x[{k}] - origin{k} - c{k} * size{k}" if offset == 0 else f"origin{k} + {m} * size{k} - x[{k}]"
                body += [f"away = qd.max({face}, 0.0)", "square -= away * away"]
        body += [
            f"if {' and '.join([*inside, 'square > 0'])}:",
            f"    base = {row_of_cells}",
            f"    along = qd.sqrt(square) + {_MARGIN} * size0",
            "    c = qd.cast(qd.floor((x[0] - along - origin0) * per0), qd.i32)",
            "    e = qd.cast(qd.floor((x[0] + along - origin0) * per0), qd.i32) + 1",
        ]
        if periodic[0]:
            body += [
                "    e = qd.min(e, c + shape0)",
                "    low[found] = cell_start[base + qd.max(c, 0)]",
                "    high[found] = cell_start[base + qd.min(e, shape0)]",
                "    found += 1",
                "    if c < 0 or e > shape0:",
                "        low[found] = cell_start[base + qd.select(c < 0, c + shape0, 0)]",
                "        high[found] = cell_start[base + qd.select(c < 0, shape0, e - shape0)]",
                "        found += 1",
            ]
        else:
            # Rows outside the grid are counted into its border cells.
            body += [
                "    low[found] = cell_start[base + qd.max(qd.min(c, shape0 - 1), 0)]",
                "    high[found] = cell_start[base + qd.min(qd.max(e, 1), shape0)]",
                "    found += 1",
            ]
    walk = [
        "for j in range(head, tail):",
        "    r = position[j] - x",
        *[f"    r[{k}] -= period{k} * qd.round(r[{k}] / period{k})" for k in axes if periodic[k]],
    ]
    body += [
        "for q in range(found):",
        # The row itself is no neighbour: where it lies in a range, that is walked in two halves.
        "    halves = qd.select((low[q] <= i) & (i < high[q]), 2, 1)",
        "    for half in range(halves):",
        "        head = qd.select(half == 1, i + 1, low[q])",
        "        tail = qd.select(half + 1 < halves, i, high[q])",
        *["        " + line for line in (_note_by_row(walk) if wide else _note_by_block(walk))],
    ]
    lines = [
        "def fill(position: Vectors, kind: Rows, cell_start: Rows, start: Starts, length: Rows, fluid: Rows,",
        "         neighbour: Rows, flag: Rows, begin: qd.i32, end: qd.i32, rows_per_block: qd.i32,",
        f"         slots_per_block: qd.i32, reach: real, {', '.join(parameters)}):",
        "    qd.loop_config(serialize=serial)",
        *(_by_row() if wide else _by_block(spread)),
        "            start[i] = first + used",
        "            length[i] = 0",
        "            fluid[i] = 0",
        f"            if kind[i] & {LISTED} != 0:",
        "                x = position[i]",
        *["                " + line for line in body],
        *["                " + line for line in (_close_by_row() if wide else _front_by_block())],
        # A wall row that sees no fluid takes part in nothing: its list is dropped.
        f"                if kind[i] & {FLUID} == 0 and fluid[i] == 0:",
        "                    used = before",
        "                length[i] = qd.min(used, slots) - qd.min(before, slots)",
        # Candidates behind a block's last neighbour are written too, the last time into its own slot: one must be left.
        "        if used >= slots:",
        f"            qd.atomic_max(flag[0], (used + 1){times})",
    ]
    return kernels.compiled(
        "fill", "\n".join(lines) + "\n", Vectors=kernels.array_type(kernels.vector(d)),
        Rows=kernels.array_type(kernels.i32), Starts=kernels.array_type(kernels.i64), real=real,
        serial=kernels.runtime().serial, Ranges=kernels.qd.types.vector(ranges, kernels.i32),
    )  # fmt: skip


def _by_block(spread: int) -> list[str]:
    """Return the loops over blocks of rows, whose lists lie packed behind each other."""
    return [
        f"    for t in range((end - begin + rows_per_block - 1) // rows_per_block * {spread}):",
        f"        block = t // {spread}",
        "        slots = slots_per_block",
        "        first = qd.cast(block, qd.i64) * slots",
        "        base_slot = qd.cast(first, qd.i32)",
        "        per0 = 1.0 / size0",
        "        used = 0",
        "        beyond = qd.min(begin + (block + 1) * rows_per_block, end)",
        f"        for i in range(begin + block * rows_per_block, qd.select(t % {spread} == 0, beyond, 0)):",
        "            before = used",
    ]


def _by_row() -> list[str]:
    """Return the loops over single rows, the lists of a block of which lie interleaved."""
    return [
        "    for t in range(end - begin):",
        "        block = t // rows_per_block",
        "        slots = slots_per_block // rows_per_block",
        "        first = qd.cast(block, qd.i64) * slots_per_block + t % rows_per_block",
        "        base_slot = qd.cast(first, qd.i32)",
        "        per0 = 1.0 / size0",
        "        used = 0",
        "        for i in range(begin + t, begin + t + 1):",
        "            before = 0",
    ]


def _note_by_block(walk: list[str]) -> list[str]:
    """Return the walk through a range that puts a row's neighbours behind those before them.

    Written without a branch: one candidate in four is near, which no branch predictor can guess.
    """
    return [
        "if used + tail - head <= slots:",
        *[f"    {line}" for line in [*walk, *_written("used")]],
        "else:",
        *[f"    {line}" for line in [*walk, *_written("qd.min(used, slots - 1)")]],
    ]


def _written(slot: str) -> list[str]:
    return [
        f"    neighbour[base_slot + {slot}] = j",
        "    used += qd.cast(r.dot(r) < reach * reach, qd.i32)",
    ]


def _front_by_block() -> list[str]:
    """Return the statements that bring fluid neighbours to the front, by swaps without a branch."""
    return [
        "head = qd.min(before, slots - 1)",
        "front = base_slot + head",
        "for k in range(head, qd.min(used, slots)):",
        "    j = neighbour[base_slot + k]",
        "    neighbour[base_slot + k] = neighbour[front]",
        "    neighbour[front] = j",
        f"    front += kind[j] & {FLUID}",
        "fluid[i] = front - base_slot - head",
    ]


def _note_by_row(walk: list[str]) -> list[str]:
    """Return the walk through a range that fills a row's slots with fluid from the front and solid from the back."""
    stride = lanes.stride()
    return [
        *walk,
        "    if r.dot(r) < reach * reach:",
        "        if used < slots:",
        "            slot = slots - 1 - solid",
        f"            if kind[j] & {FLUID} != 0:",
        "                slot = used - solid",
        "            else:",
        "                solid += 1",
        f"            neighbour[base_slot + slot * {stride}] = j",
        "        used += 1",
    ]


def _close_by_row() -> list[str]:
    """Return the statements that close the gap between fluid and solid neighbours.

    All of the latter move, so that their order does not depend on how many slots there are.
    """
    stride = lanes.stride()
    return [
        "fluid[i] = qd.min(used, slots) - solid",
        "for k in range(qd.select(used < slots, solid, 0)):",
        f"    neighbour[base_slot + (fluid[i] + k) * {stride}] = neighbour[base_slot + (slots - solid + k) * {stride}]",
    ]
