"""Particle arrangements that tests of operators share, and sums over them in plain NumPy."""

import numpy as np

from spume.lattice import Lattice
from spume.pairs import Pairs
from spume.particles import FLUID, Field, Particles
from spume.schemes.number_density.base import SOLID_DENSITY

EXTRA_FIELDS = (
    Field("scalar", doc="a field to differentiate"),
    Field("vector", ("d",), doc="a field to write"),
    Field("answer", doc="a field to write"),
    Field("answer_2", doc="a field to write"),
    Field("tensor", ("d", "d"), doc="a field to write"),
    Field("whole", doc="an integer field to write", dtype=int),
    SOLID_DENSITY,  # the number density is asked in many tests beside what they are about
)


def block(d, cells, spacing=0.1, disturbance=0.0, seed=1):
    """Return the centres of a block of cells around the origin, each coordinate moved by up to disturbance l0."""
    axes = [(np.arange(cells) - (cells - 1) / 2) * spacing] * d
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, d)
    return points + np.random.default_rng(seed).uniform(-1, 1, points.shape) * disturbance * spacing


def table(position, spacing=0.1, fields=(), reach=2.1, skin=0.2, region=None, periodic=None, **rows):
    """Return (lattice, particles, pairs) with neighbour lists up to date.

    Args:
        position: (n, d) [m].
        fields: fields beyond the base fields and ``EXTRA_FIELDS``.
        reach, skin: search radius and skin as multiples of the spacing.
        region: (lower, upper) [m]; default: far away.
        rows: further fields of the rows.
    """
    position = np.asarray(position, dtype=float)
    n, d = position.shape
    particles = Particles(d, spacing, (*EXTRA_FIELDS, *fields), capacity=n)
    given = {"kind": np.full(n, FLUID), "density": np.full(n, 1000.0)} | rows
    particles.insert({"position": position, **given})
    lower, upper = region if region is not None else ([-1e3] * d, [1e3] * d)
    pairs = Pairs(reach * spacing, skin * spacing, lower, upper, periodic)
    pairs.update(particles)
    return Lattice(d, spacing), particles, pairs


def inside(position, cells, spacing=0.1, reach=2.1, disturbance=0.0):
    """Return which rows of a ``block`` see no edge of it."""
    largest = (cells / 2 - reach - disturbance) * spacing
    return np.all(np.abs(position) < largest, axis=1)


def cloud(d, disturbance, fields=(), **rows):
    """Return (lattice, particles, pairs, core): a block of one size for all tests, and which rows see no edge of it."""
    cells = 10 if d == 2 else 7
    lattice, particles, pairs = table(block(d, cells, disturbance=disturbance), fields=fields, **rows)
    core = inside(particles.numpy("position"), cells, disturbance=disturbance)
    assert core.sum() >= 20 if d == 2 else core.any()
    return lattice, particles, pairs, core


def offsets(position, period=None):
    """Return r_ij = x_j - x_i, shape (n, n, d), through periodic boundaries where ``period`` is finite."""
    r = position[None, :, :] - position[:, None, :]
    if period is not None:
        period = np.asarray(period, dtype=float)
        joined = np.isfinite(period)
        r[..., joined] -= period[joined] * np.round(r[..., joined] / period[joined])
    return r


def weights(r, weight, re):
    """Return W(|r_ij|, re), shape (n, n): zero beyond re and for a row with itself."""
    distance = np.linalg.norm(r, axis=-1)
    near = (distance < re) & ~np.eye(len(distance), dtype=bool)
    w = np.zeros_like(distance)
    w[near] = weight.values(distance[near], re)
    return w
