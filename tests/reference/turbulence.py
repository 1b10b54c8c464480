"""Kinematic viscosities with what unresolved motion adds."""

import numpy as np

from reference.gradient import floored, matrix


def none(cloud):
    """The fluid's own."""
    return cloud.nu


def smagorinsky(cloud, constant=0.15, floor=0.3):
    """nu + (C_s l0)^2 (2 S:S)^1/2, S the symmetric part of grad u = d/n0 sum_j u_ij (x) C_i r_ij/r^2 W.

    Of the matrix whose inverse C_i is, eigenvalues are raised to the floor.
    """
    nu = cloud.nu.copy()
    for i in range(len(cloud)):
        C = np.linalg.inv(floored(np.linalg.inv(matrix(cloud, i)), floor))
        slope = np.zeros((cloud.d, cloud.d))
        for j, r, s, w in cloud.neighbours(i):
            slope += cloud.d / cloud.n0 * np.outer(cloud.u[j] - cloud.u[i], C @ r) / s**2 * w
        S = (slope + slope.T) / 2
        nu[i] += (constant * cloud.l0) ** 2 * (2 * (S * S).sum()) ** 0.5
    return nu
