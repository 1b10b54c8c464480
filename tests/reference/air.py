"""Pressures of enclosed air, by cells in a dictionary and a walk from each void cell to those beside it."""

from itertools import product

import numpy as np

from reference.cloud import cloud_for

SQUEEZED = 0.99
"""All rows come nearer to the middle by this, from the first instant to the second."""


def hollow(cloud):
    """Return positions of a block of the cloud's kind from whose middle a cube of five rows is missing."""
    block = cloud_for(cloud.d, cells={2: 11, 3: 9}[cloud.d])
    return block.x[np.abs(np.round(block.x / block.l0)).max(axis=1) > 2.5]


def none(cloud):
    """Nothing beyond the surface."""
    return np.zeros(len(hollow(cloud)))


def filled(x, l0):
    """Return which part of each cell is filled, by its index: quadratic B-splines of the rows, in whole 2^-20."""
    parts = {}
    for row in x / l0:
        home = np.floor(row).astype(int)
        t = row - home - 0.5
        beside = (0.5 * (0.5 - t) ** 2, 0.75 - t**2, 0.5 * (0.5 + t) ** 2)
        for offset in product((-1, 0, 1), repeat=len(row)):
            weight = np.prod([beside[o + 1][k] for k, o in enumerate(offset)])
            cell = tuple(int(c) for c in home + offset)
            parts[cell] = parts.get(cell, 0.0) + np.floor(weight * 2**20 + 0.5) / 2**20
    return parts


def region(parts, d):
    """Return the cells of the void around the origin, and those with up to two more around them."""
    void, front = set(), [(0,) * d]
    while front:
        cell = front.pop()
        if cell in void or parts.get(cell, 0.0) >= 0.5:
            continue
        void.add(cell)
        assert max(map(abs, cell)) < 6, "the void is open"
        for axis, way in product(range(d), (-1, 1)):
            front.append((*cell[:axis], cell[axis] + way, *cell[axis + 1 :]))
    near = product((-2, -1, 0, 1, 2), repeat=d)
    return {tuple(c + o for c, o in zip(cell, offset, strict=True)) for offset in near for cell in void}


def empty(cells, parts, l0, d):
    """Return the volume of what no row fills in some cells."""
    return l0**d * sum(1.0 - parts.get(cell, 0.0) for cell in cells)


def adiabatic(cloud, pressure=101325.0, exponent=1.4, relaxation=0.05):
    """P_0 [(V_0/V)^gamma - 1] after all rows have come nearer to the middle, at each row, in P_0.

    V is what the cells of the start have lost, and a share of the difference to the volume around the void as it is
    now. A row has it if cells of the void, or beside it, lie within 2.1 of its place that are not full.
    """
    l0, d, x = cloud.l0, cloud.d, hollow(cloud)
    before = filled(x, l0)
    cells = region(before, d)
    air = empty(cells, before, l0, d)
    x = SQUEEZED * x
    after = filled(x, l0)
    volume = air + empty(cells, after, l0, d) - empty(cells, before, l0, d)
    cells = region(after, d)
    volume += relaxation * (empty(cells, after, l0, d) - volume)
    over = pressure * ((air / volume) ** exponent - 1.0)
    result = np.zeros(len(x))
    for i, row in enumerate(x / l0):
        home = np.floor(row).astype(int)
        for offset in product((-2, -1, 0, 1, 2), repeat=d):
            cell = tuple(int(c) for c in home + offset)
            square = ((np.array(cell) + 0.5 - row) ** 2).sum() / 2.1**2
            if cell in cells and square < 1.0 and after.get(cell, 0.0) < 1.0:
                result[i] = over / pressure
    return result
