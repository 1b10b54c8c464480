"""Viscous accelerations."""

import numpy as np

from reference.cloud import DT


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
