"""A disturbed cloud of particles, written by formula, and the sums over its neighbours."""

from copy import copy
from functools import cache
from importlib import import_module
from itertools import product
from math import sqrt

import numpy as np

DT = 0.02
DT_BEFORE = 0.016
"""Time step, and the one before [s]."""


def scattered(shape, seed):
    """Return numbers in -1 … 1 without a pattern: twice the fractional part of k^2 sqrt(seed), less one."""
    k = np.arange(1, int(np.prod(shape)) + 1, dtype=float)
    return (2.0 * np.modf(k * k * sqrt(seed))[0] - 1.0).reshape(shape)


class Cloud:
    """A square or cubic block around the origin, each coordinate moved by up to ``disturbance`` l0.

    Attributes:
        x, u: positions [m] and velocities [m/s], shape (n, d).
        phi: a field to differentiate, with values of both signs; no two neighbours are alike.
        rho, nu: density and kinematic viscosity of the rows.
        force: acceleration of the rows by all but the pressure [m/s^2].
        slope: some gradient of phi of the step before.
        before, u_before: positions of the two instants before, velocities of the later one.
        share: share of the rows in the free surface, 0 … 1, where a test sets one.
        inner: rows that are not in the block's outermost layer.
        re: effective radius [m]; W: weight function of r and re.
        n0, lambda_: reference sums of the undisturbed lattice.
    """

    def __init__(self, d, re=2.1, weight="inverse", disturbance=0.2, cells=None, l0=0.1):
        cells = cells or {2: 9, 3: 6}[d]
        self.d, self.l0, self.cells, self.re = d, l0, cells, re * l0
        self.W = loop("weight", weight)
        corners = np.array(list(product(range(cells), repeat=d)), dtype=float) - (cells - 1) / 2
        self.inner = np.abs(corners).max(axis=1) < (cells - 1) / 2 - 0.5
        self.x = l0 * (corners + disturbance * scattered(corners.shape, 2))
        self.u = scattered(corners.shape, 3)
        self.phi = 500.0 + 1000.0 * scattered(len(corners), 5)
        self.rho = 1000.0 + 500.0 * scattered(len(corners), 23)
        self.slope = 1000.0 * self.u
        self.before = [self.x + 0.05 * l0 * scattered(corners.shape, seed) for seed in (13, 17)]
        self.u_before = scattered(corners.shape, 19)
        self.share = 0.5 * (1.0 + scattered(len(corners), 11))
        self.force = 10.0 * scattered(corners.shape, 29)
        self.nu = 0.1 * (1.5 + scattered(len(corners), 7))
        self.n0, self.lambda_ = self.lattice_sums()

    def lattice_sums(self):
        """Return n0 = sum W and lambda = sum W r^2/sum W of the undisturbed lattice."""
        w = [(self.W(s, self.re), s) for s in self.lattice_distances()]
        n0 = sum(v for v, _ in w)
        return n0, sum(v * s * s for v, s in w) / n0

    def lattice_distances(self):
        """Return the distances of the neighbours of a row in the undisturbed lattice."""
        cells = range(-int(self.re / self.l0) - 1, int(self.re / self.l0) + 2)
        r = [self.l0 * sqrt(sum(k * k for k in cell)) for cell in product(cells, repeat=self.d) if any(cell)]
        return [s for s in r if s < self.re]

    def moved(self, x, u=None):
        """Return the cloud with other positions, and perhaps velocities."""
        other = copy(self)
        other.x, other.u = x, self.u if u is None else u
        other.__dict__.pop("_rows", None)
        return other

    def __len__(self):
        return len(self.x)

    def neighbours(self, i, re=None):
        """Yield j, r_ij = x_j - x_i, |r_ij| and W(|r_ij|, re) for every j nearer than re."""
        re = re or self.re
        for j in np.flatnonzero(((self.x - self.x[i]) ** 2).sum(axis=1) < 1.01 * re**2):
            r = self.x[j] - self.x[i]
            distance = sqrt(r @ r)
            if j != i and distance < re:
                yield j, r, distance, self.W(distance, re)

    def scalars(self):
        """Return zeros, one per row."""
        return np.zeros(len(self))

    def vectors(self):
        """Return zero vectors, one per row."""
        return np.zeros((len(self), self.d))


@cache
def cloud_for(d, re=2.1, weight="inverse", disturbance=0.2, cells=None, l0=0.1, shore=False):
    """Return a cloud; with ``shore`` all rows beyond x = 1.5 l0 are on the surface, and no others."""
    cloud = Cloud(d, re=re, weight=weight, disturbance=disturbance, cells=cells, l0=l0)
    if shore:
        cloud.share = 1.0 * (cloud.x[:, 0] > 1.5 * l0)
    return cloud


def checksum(values, rows=None):
    """Return sum_k cos(k + 1) v_k over all components of the given rows: it sees each of them."""
    flat = np.asarray(values, dtype=float)[slice(None) if rows is None else rows].ravel()
    return float(np.cos(np.arange(1, len(flat) + 1)) @ flat)


def reference_value(family, key, cloud, arguments=None, text=None):
    """Return the checksum that the double loop of a scheme gives on the cloud's inner rows."""
    function = loop(family, key, text)
    if family == "weight":
        return checksum([function(r, 0.21) for r in 0.11 + 0.09 * scattered(9, 2)])
    return checksum(function(cloud, **(arguments or {})), compared(family, cloud))


def compared(family, cloud):
    """Return the rows that are compared: those of the outermost layer have too few neighbours for some matrices."""
    if family == "air":  # of other rows, all of them
        return None
    return cloud.inner if family in ("gradient", "laplacian", "divergence") else np.full(len(cloud), True)


def loop(family, key, text=None):
    """Return the double loop of a scheme: the function of that name, or the one that a text defines."""
    module = import_module(f"reference.{family}")
    word = key.replace("-", "_")
    if text is not None:
        scope = dict(vars(module))
        exec(text, scope)
        return scope[word]
    return getattr(module, f"{word}_", None) or getattr(module, word)  # sum_: the name alone is taken
