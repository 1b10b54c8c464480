"""Divergences of the velocity."""

import numpy as np

from reference.gradient import bounded as towards_identity
from reference.gradient import floored, matrix


def original(cloud):
    """d/n0 sum_j u_ij . r_ij/r^2 W."""
    div = cloud.scalars()
    for i in range(len(cloud)):
        for j, r, s, w in cloud.neighbours(i):
            div[i] += cloud.d / cloud.n0 * (cloud.u[j] - cloud.u[i]) @ r / s**2 * w
    return div


def corrected(cloud):
    """d/n0 sum_j u_ij . C_i r_ij/r^2 W."""
    div = cloud.scalars()
    for i in range(len(cloud)):
        C = matrix(cloud, i)
        for j, r, s, w in cloud.neighbours(i):
            div[i] += cloud.d / cloud.n0 * (cloud.u[j] - cloud.u[i]) @ (C @ r) / s**2 * w
    return div


def blended(cloud):
    """d/n0 sum_j u_ij . [(1 - theta_i) C_i + theta_i I] r_ij/r^2 W, C_i = [M_i + theta_i (I - M_i)]^-1."""
    div = cloud.scalars()
    for i in range(len(cloud)):
        share = cloud.share[i]
        moment = towards_identity(np.linalg.inv(matrix(cloud, i)), share)
        blend = (1 - share) * np.linalg.inv(moment) + share * np.eye(cloud.d)
        for j, r, s, w in cloud.neighbours(i):
            div[i] += cloud.d / cloud.n0 * (cloud.u[j] - cloud.u[i]) @ (blend @ r) / s**2 * w
    return div


def bounded(cloud, floor=0.6):
    """d/n0 sum_j u_ij . C_i r_ij/r^2 W, C_i = [M_i + max(floor - least eigenvalue of M_i, 0) I]^-1."""
    div = cloud.scalars()
    for i in range(len(cloud)):
        C = np.linalg.inv(floored(np.linalg.inv(matrix(cloud, i)), floor))
        for j, r, s, w in cloud.neighbours(i):
            div[i] += cloud.d / cloud.n0 * (cloud.u[j] - cloud.u[i]) @ (C @ r) / s**2 * w
    return div


def bounded_stretched(cloud):
    """Of rows drawn apart along x by the half: few neighbours are left, and the floor acts."""
    return bounded(cloud.moved(cloud.x * (1.0 + 0.5 * np.eye(cloud.d)[0])))
