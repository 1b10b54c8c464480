"""Synthetic free surfaces on which detections are counted: which rows are surely on them, which surely not."""

import itertools
from dataclasses import dataclass

import numpy as np

from arrangements import table
from spume.particles import DUMMY, FLUID, WALL
from spume.schemes.number_density.base import Original as NumberDensity

L0 = 0.1
SHAPES = ("bulk", "flat", "corner", "film", "drop", "bubble", "tank")


@dataclass(frozen=True)
class Surface:
    """An arrangement with its true surface.

    Attributes:
        position: centres [m].
        kind: kind of each row.
        on: fluid rows on the surface: one of their 2 d nearest cells is empty.
        off: fluid rows off it: all cells around them are filled. The others are neither.
        period: period along each axis [m], inf where there is none.
    """

    position: np.ndarray
    kind: np.ndarray
    on: np.ndarray
    off: np.ndarray
    period: np.ndarray


def surface(shape: str, d: int, disturbance: float = 0.0, seed: int = 1) -> Surface:
    """Return one of ``SHAPES`` in d dimensions, each fluid coordinate moved by up to ``disturbance`` l0.

    bulk: periodic without a surface; flat: a layer between two planes; corner: a block with edges and corners;
    film: two layers of rows; drop: a ball; bubble: a round hole in the bulk; tank: water between walls.
    """
    n = 14 if d == 2 else 10
    cells = np.stack(np.meshgrid(*[np.arange(n)] * d, indexing="ij"), axis=-1).reshape(-1, d)
    radius = np.linalg.norm(cells - (n - 1) / 2, axis=1)
    height = cells[:, -1]
    joined = np.zeros(d, dtype=bool)
    if shape in ("bulk", "bubble"):
        joined[:] = True
    elif shape in ("flat", "film"):
        joined[:-1] = True
    edge = np.any((cells < 3) | (cells >= n - 3), axis=1)
    sides = np.any((cells[:, :-1] < 3) | (cells[:, :-1] >= n - 3), axis=1)
    solid = (sides | (height < 3)) & (shape == "tank")
    filled = {
        "bulk": np.ones(len(cells), dtype=bool),
        "flat": (height >= 3) & (height < n - 3),
        "corner": ~edge,
        "film": (height >= 5) & (height < 7),
        "drop": radius < n / 2 - 1,
        "bubble": radius > 2.6,
        "tank": solid | (height < n - 3),
    }[shape]
    taken = {tuple(cell) for cell in cells[filled]}

    def full(offsets):
        found = np.ones(len(cells), dtype=bool)
        for offset in offsets:
            near = cells + np.array(offset)
            near = np.where(joined, near % n, near)
            found &= [tuple(cell) in taken for cell in near]
        return found

    faces = [tuple(sign * (np.arange(d) == k)) for k in range(d) for sign in (-1, 1)]
    around = [offset for offset in itertools.product((-1, 0, 1), repeat=d) if any(offset)]
    fluid = filled & ~solid
    wall = np.zeros(len(cells), dtype=bool)
    if shape == "tank":
        near_fluid = {tuple(cell + np.array(o)) for cell in cells[fluid] for o in around}
        wall = solid & np.array([tuple(cell) in near_fluid for cell in cells])
    # Below the rim of a tank nothing is missing; above it the cells of the room are empty.
    on, off = fluid & ~full(faces), fluid & full(around)
    kind = np.where(fluid, FLUID, np.where(wall, WALL, DUMMY))
    moved = np.random.default_rng(seed).uniform(-disturbance, disturbance, cells.shape) * fluid[:, None]
    position = (cells + 0.5 + moved)[filled] * L0
    period = np.where(joined, n * L0, np.inf)
    return Surface(position, kind[filled], on[filled], off[filled], period)


def mark(scheme, case: Surface, fields=()):
    """Return (lattice, particles, number density) after the scheme marked the rows, those in the order of ``case``."""
    d = case.position.shape[1]
    joined = np.isfinite(case.period)
    position = np.where(joined, case.position % np.where(joined, case.period, 1.0), case.position)
    region = (np.where(joined, 0.0, -10.0), np.where(joined, case.period, 10.0))
    reach = max(scheme.re, 2.1)
    lattice, particles, pairs = table(
        position, fields=dict.fromkeys((*scheme.needs, *fields)), reach=reach, skin=0.1, region=region,
        periodic=joined.tolist(), kind=case.kind,
    )  # fmt: skip
    number_density = NumberDensity(re=reach)
    number_density(lattice, particles, pairs)
    scheme(lattice, particles, pairs, number_density)
    assert lattice.dimension == d
    return lattice, particles, number_density


def by_id(particles, name: str) -> np.ndarray:
    """Return a field in the order in which the rows were inserted."""
    return particles.numpy(name)[np.argsort(particles.numpy("id"))]


def errors(scheme, case: Surface) -> tuple[int, int]:
    """Return how many rows on the surface were missed and how many off it were marked."""
    _, particles, _ = mark(scheme, case)
    marked = by_id(particles, "free_surface") == 1
    return int((case.on & ~marked).sum()), int((case.off & marked).sum())
