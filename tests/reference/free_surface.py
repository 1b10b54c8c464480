"""Shares of rows in the free surface, 0 inside to 1 on it."""

from math import cos, pi, sqrt

import numpy as np

from reference.images import images
from reference.number_density import original as density_of


def number_density_(cloud, beta=0.95):
    """1 where n < beta n0."""
    return 1.0 * (density_of(cloud) < beta * cloud.n0)


def blended(cloud, upper=0.9, lower=0.75):
    """(upper - n/n0)/(upper - lower), limited to 0 ... 1."""
    share = (upper - density_of(cloud) / cloud.n0) / (upper - lower)
    return share.clip(0.0, 1.0)


def detection_free(cloud, full=0.3):
    """(1 - n/n0)/full, limited to 0 ... 1."""
    return ((1 - density_of(cloud) / cloud.n0) / full).clip(0.0, 1.0)


def lattice(cloud, re):
    """Vectors to the neighbours of a row of the undisturbed lattice."""
    cells = (np.array(cell) - 4 for cell in np.ndindex(*[9] * cloud.d))
    return [cloud.l0 * cell for cell in cells if 0 < np.linalg.norm(cell) < re]


def position_divergence(cloud):
    """sum_j V_j r_ij . grad K with Wendland's K, r K' ~ q^2 (1 - q)^3, q = r/re; d on the lattice."""
    wendland = [np.linalg.norm(r) / cloud.re for r in lattice(cloud, cloud.re / cloud.l0)]
    scale = cloud.d / sum(q**2 * (1 - q) ** 3 for q in wendland)
    div = cloud.scalars()
    for i in range(len(cloud)):
        for _, _, s, _ in cloud.neighbours(i):
            div[i] += scale * (s / cloud.re) ** 2 * (1 - s / cloud.re) ** 3
    return div


def divergence_of_position(cloud):
    """1 where div r < 1.6 in 2D, 2.55 in 3D."""
    return 1.0 * (position_divergence(cloud) < {2: 1.6, 3: 2.55}[cloud.d])


def asymmetry(cloud, beta=0.97, re=1.85, alpha=0.4):
    """1 where n < beta n0 and |sum_j r_ij| > alpha times that of a flat surface, or n < beta n0/2."""
    flat = sum(-r[-1] for r in lattice(cloud, re) if r[-1] < 0)
    n, share = density_of(cloud), cloud.scalars()
    for i in range(len(cloud)):
        total = sum((r for _, r, _, _ in cloud.neighbours(i, re * cloud.l0)), np.zeros(cloud.d))
        one_sided = np.linalg.norm(total) > alpha * flat or n[i] < 0.5 * beta * cloud.n0
        share[i] = n[i] < beta * cloud.n0 and one_sided
    return share


def vector(cloud, lower=0.8, upper=0.97, alpha=0.9):
    """1 where n < lower n0, or n < upper n0 and |d/n0 sum_j W r_ij/r| > alpha times that of a flat surface."""
    steps = [(r, np.linalg.norm(r)) for r in lattice(cloud, cloud.re / cloud.l0)]
    flat = sum(cloud.d / cloud.n0 * cloud.W(s, cloud.re) * -r[-1] / s for r, s in steps if r[-1] < 0)
    n, share = density_of(cloud) / cloud.n0, cloud.scalars()
    for i in range(len(cloud)):
        F = np.zeros(cloud.d)
        for _, r, s, w in cloud.neighbours(i):
            F += cloud.d / cloud.n0 * w * r / s
        share[i] = n[i] < lower or (n[i] < upper and np.linalg.norm(F) > alpha * flat)
    return share


def normal(cloud, i):
    """-B^-1 b/|B^-1 b|, b = sum_j v r_ij, B = sum_j v r_ij (x) r_ij, v = (1 - r/re)^2; B = I where it is singular."""
    b, B = np.zeros(cloud.d), np.zeros((cloud.d, cloud.d))
    for _, r, s, _ in cloud.neighbours(i):
        b += (1 - s / cloud.re) ** 2 * r / cloud.re
        B += (1 - s / cloud.re) ** 2 * np.outer(r, r) / cloud.re**2
    regular = abs(np.linalg.det(B / max(np.trace(B) / cloud.d, 1e-12))) > 1e-3
    n = -np.linalg.solve(B, b) if regular else -b
    return n / max(np.linalg.norm(n), 1e-12)


def covered(cloud, i):
    """Whether a neighbour lies in the cone of 45 degrees around n up to sqrt(2) h, or beyond in the ball at x + h n."""
    n, h = normal(cloud, i), cloud.re / 2
    for _, r, s, _ in cloud.neighbours(i):
        if (np.linalg.norm(r - h * n) < h) if s >= sqrt(2) * h else (r @ n > cos(pi / 4) * s):
            return True
    return False


def umbrella(cloud, lower=0.2, upper=0.75):
    """1 where the least eigenvalue of d/n0 sum_j W r (x) r/r^2 is below 0.2, 0 above 0.75, else by the scan."""
    share = cloud.scalars()
    for i in range(len(cloud)):
        moment = np.zeros((cloud.d, cloud.d))
        for _, r, s, w in cloud.neighbours(i):
            moment += cloud.d / cloud.n0 * w * np.outer(r, r) / s**2
        least = np.linalg.eigvalsh(moment)[0]
        share[i] = least < lower or (least <= upper and not covered(cloud, i))
    return share


def hybrid(cloud, part=0.9):
    """1 where div r < 0.9 d and the scan finds nothing."""
    div = position_divergence(cloud)
    return np.array([1.0 * (div[i] < part * cloud.d and not covered(cloud, i)) for i in range(len(cloud))])


def blended_drawn(cloud):
    """Flag theta > 1/2, addition 2 d/(lambda rho) theta/(1.02 - theta) to the diagonal, surface pressure [kPa]."""
    share = blended(cloud)
    diagonal = 2 * cloud.d / (cloud.lambda_ * cloud.rho) * share / (1.02 - share)
    return np.stack([share > 0.5, diagonal, cloud.phi / 1000], axis=1)


def detection_free_drawn(cloud):
    """Flag theta > 1/2, addition 2 d/(lambda rho) (1 - n/n0)^+ to the diagonal, no surface pressure."""
    missing = (1 - density_of(cloud) / cloud.n0).clip(0.0)
    diagonal = 2 * cloud.d / (cloud.lambda_ * cloud.rho) * missing
    return np.stack([detection_free(cloud) > 0.5, diagonal, cloud.scalars()], axis=1)


def imaged(cloud):
    """The share of blended."""
    return blended(cloud)


def imaged_drawn(cloud):
    """Flag, addition 2/rho theta max(|b|/delta, [(1 - n/n0)/m - 1] 2 |b|/l0 of a flat surface), no surface pressure.

    b and delta are those of the images; m is the share of n0 that a row on a flat surface of the lattice misses.
    """
    share, n = imaged(cloud), density_of(cloud) / cloud.n0
    around = [(r, np.linalg.norm(r)) for r in lattice(cloud, cloud.re / cloud.l0)]
    above = [(r, s) for r, s in around if r[-1] > 0.5 * cloud.l0]
    m = sum(cloud.W(s, cloud.re) for _, s in above) / cloud.n0
    flat = sum(cloud.d / cloud.n0 * cloud.W(s, cloud.re) * r[-1] / s**2 for r, s in above)
    shared = cloud.moved(cloud.x)
    shared.share = share
    b, delta = images(shared)
    drawn = np.maximum(np.linalg.norm(b, axis=1) / delta, ((1 - n) / m - 1) * 2 * flat / cloud.l0)
    return np.stack([share > 0.5, 2 / cloud.rho * share * drawn, cloud.scalars()], axis=1)
