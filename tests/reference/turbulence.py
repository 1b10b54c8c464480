"""Kinematic viscosities with what unresolved motion adds."""

import numpy as np

from reference.gradient import matrix


def none(cloud):
    """The fluid's own."""
    return cloud.nu


def smagorinsky(cloud, constant=0.15):
    """nu + (C_s l0)^2 (2 S:S)^1/2, S the symmetric part of grad u = d/n0 sum_j u_ij (x) C_i r_ij/r^2 W."""
    nu = cloud.nu.copy()
    for i in range(len(cloud)):
        C, slope = matrix(cloud, i), np.zeros((cloud.d, cloud.d))
        for j, r, s, w in cloud.neighbours(i):
            slope += cloud.d / cloud.n0 * np.outer(cloud.u[j] - cloud.u[i], C @ r) / s**2 * w
        S = (slope + slope.T) / 2
        nu[i] += (constant * cloud.l0) ** 2 * (2 * (S * S).sum()) ** 0.5
    return nu
