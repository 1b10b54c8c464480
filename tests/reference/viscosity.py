"""Viscous accelerations."""

import numpy as np

from reference.cloud import DT
from reference.collision import walls


def none(cloud):
    """No acceleration."""
    return cloud.vectors()


def shared(cloud, i, j):
    """Harmonic mean of rho nu."""
    one, other = cloud.rho[i] * cloud.nu[i], cloud.rho[j] * cloud.nu[j]
    return 2 * one * other / (one + other)


def explicit(cloud):
    """1/rho_i 2 d/(lambda n0) sum_j mu_ij (u_j - u_i) W."""
    a = cloud.vectors()
    for i in range(len(cloud)):
        for j, _, _, w in cloud.neighbours(i):
            share = 2 * cloud.d / (cloud.lambda_ * cloud.n0) * shared(cloud, i, j) * w
            a[i] += share * (cloud.u[j] - cloud.u[i]) / cloud.rho[i]
    return a


def implicit(cloud):
    """(v - u)/dt with rho_i (v_i - u_i)/dt = 2 d/(lambda n0) sum_j mu_ij (v_j - v_i) W."""
    n = len(cloud)
    A = np.zeros((n, n))
    for i in range(n):
        A[i, i] += cloud.rho[i] / DT
        for j, _, _, w in cloud.neighbours(i):
            share = 2 * cloud.d / (cloud.lambda_ * cloud.n0) * shared(cloud, i, j) * w
            A[i, i] += share
            A[i, j] -= share
    return (np.linalg.solve(A, cloud.rho[:, None] * cloud.u / DT) - cloud.u) / DT


def implicit_at_wall(cloud):
    """(v - u)/dt, where some rows are solid: rho_i (v_i - u_i)/dt = 2 d/(lambda n0) sum_j mu_ij (v_ij - v_i) W.

    A solid row moves like the image of i, v_ij - v_i = s (u_wall - v_i): with depth the distance of the solid row from
    the surface of its wall and h that of i from the plane through the solid row, s = h/(h - depth) for h > depth, so
    that a linear profile goes through the surface; s = 1 where i is behind it. Every fourth row is of a free-slip
    wall, s = 0. Solid rows have the viscosity of i.
    """
    solid, to_surface = walls(cloud)
    n, slip, u_wall = len(cloud), slipping(cloud), cloud.u_before
    A, b = np.eye(n), np.zeros((n, cloud.d))
    for i in np.flatnonzero(~solid):
        A[i, i], b[i] = cloud.rho[i] / DT, cloud.rho[i] * cloud.u[i] / DT
        for j, r, _, w in cloud.neighbours(i):
            c = 2 * cloud.d / (cloud.lambda_ * cloud.n0) * w
            if solid[j]:
                depth = np.linalg.norm(to_surface[j])
                h = -r @ to_surface[j] / depth
                share = 0.0 if slip[j] else h / max(h - depth, 1e-6 * depth) if h > depth else 1.0
                A[i, i] += c * cloud.rho[i] * cloud.nu[i] * share
                b[i] += c * cloud.rho[i] * cloud.nu[i] * share * u_wall[j]
            else:
                A[i, i] += c * shared(cloud, i, j)
                A[i, j] -= c * shared(cloud, i, j)
    return np.where(solid[:, None], 0.0, (np.linalg.solve(A, b) - cloud.u) / DT)


def slipping(cloud):
    """Every fourth row, of which the solid ones belong to a free-slip wall."""
    return np.arange(len(cloud)) % 4 == 0
