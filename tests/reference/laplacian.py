"""Laplacians of ``phi``."""

import numpy as np

from reference.gradient import corrected, dummy_distance, matrix, taylor


def original(cloud):
    """2 d/(lambda n0) sum_j (phi_j - phi_i) W."""
    lap = cloud.scalars()
    for i in range(len(cloud)):
        for j, _, _, w in cloud.neighbours(i):
            lap[i] += 2 * cloud.d / (cloud.lambda_ * cloud.n0) * (cloud.phi[j] - cloud.phi[i]) * w
    return lap


def distance(cloud):
    """2 d/n0 sum_j (phi_j - phi_i)/r^2 W."""
    lap = cloud.scalars()
    for i in range(len(cloud)):
        for j, _, s, w in cloud.neighbours(i):
            lap[i] += 2 * cloud.d / cloud.n0 * (cloud.phi[j] - cloud.phi[i]) / s**2 * w
    return lap


def compensated(cloud):
    """2 d/(lambda n0) sum_j [phi_j - phi_i - (1 - theta_i) r_ij . grad phi] W with the gradient of the step before."""
    lap, g = cloud.scalars(), (1 - cloud.share)[:, None] * cloud.slope
    for i in range(len(cloud)):
        for j, r, _, w in cloud.neighbours(i):
            lap[i] += 2 * cloud.d / (cloud.lambda_ * cloud.n0) * (cloud.phi[j] - cloud.phi[i] - r @ g[i]) * w
    return lap


def distance_compensated(cloud):
    """2 d/n0 sum_j [phi_j - phi_i - (1 - theta_i) r_ij . grad phi]/r^2 W with the gradient of the step before."""
    lap, g = cloud.scalars(), (1 - cloud.share)[:, None] * cloud.slope
    for i in range(len(cloud)):
        for j, r, s, w in cloud.neighbours(i):
            lap[i] += 2 * cloud.d / cloud.n0 * (cloud.phi[j] - cloud.phi[i] - r @ g[i]) / s**2 * w
    return lap


def higher_order(cloud, factor):
    """factor re/n0 sum_j (phi_j - phi_i)/r^3, for W = re/r - 1 (w'' = 2 re/r^3, w' = -re/r^2)."""
    if factor == "published":  # 2D: w'' - w'/r, 3D: w''
        factor = {2: 3.0, 3: 2.0}[cloud.d]
    elif factor == "consistent":  # exact for |x|^2 in the limit of large re
        factor = 2.0
    elif factor == "calibrated":  # exact for |x|^2 on the lattice: factor sum re/r = 2 d n0
        rings = cloud.lattice_distances()
        factor = 2 * cloud.d * cloud.n0 / sum(cloud.re / s for s in rings)
    lap = cloud.scalars()
    for i in range(len(cloud)):
        for j, _, s, _ in cloud.neighbours(i):
            lap[i] += factor * cloud.re / cloud.n0 * (cloud.phi[j] - cloud.phi[i]) / s**3
    return lap


def corrected_vector(cloud):
    """d/n0 sum_j (phi_j - phi_i) (2/lambda - L_i . C_i r_ij/r^2) W, L_i = 2 d/(n0 lambda) sum_j r_ij W."""
    lap = cloud.scalars()
    for i in range(len(cloud)):
        C, L = matrix(cloud, i), np.zeros(cloud.d)
        for _, r, _, w in cloud.neighbours(i):
            L += 2 * cloud.d / (cloud.n0 * cloud.lambda_) * r * w
        for j, r, s, w in cloud.neighbours(i):
            share = 2 / cloud.lambda_ - L @ (C @ r) / s**2
            lap[i] += cloud.d / cloud.n0 * (cloud.phi[j] - cloud.phi[i]) * share * w
    return lap


def corrected_vector_distance(cloud):
    """2 d/n0 sum_j (phi_j - phi_i - r_ij . g)/r^2 W with the corrected gradient g."""
    lap, g = cloud.scalars(), corrected(cloud)
    for i in range(len(cloud)):
        for j, r, s, w in cloud.neighbours(i):
            lap[i] += 2 * cloud.d / cloud.n0 * (cloud.phi[j] - cloud.phi[i] - r @ g[i]) / s**2 * w
    return lap


def dummy_neighbour(cloud):
    """2 d/n0 [sum_j (phi_j - phi_i)/r^2 W + (phi_d - phi_i)/r_d^2 W_d], the dummy where it balances the surroundings.

    phi_d = phi_i + r_d . g with the corrected gradient g inside the fluid, 0 in the open, by the row's share.
    """
    lap, g = cloud.scalars(), corrected(cloud)
    for i in range(len(cloud)):
        lack = np.zeros(cloud.d)
        for j, r, s, w in cloud.neighbours(i):
            lack += w * r / s**2
            lap[i] += 2 * cloud.d / cloud.n0 * (cloud.phi[j] - cloud.phi[i]) / s**2 * w
        s = dummy_distance(cloud, np.linalg.norm(lack))
        r, w, share = -s * lack / np.linalg.norm(lack), cloud.W(s, cloud.re), cloud.share[i]
        lap[i] += 2 * cloud.d / cloud.n0 * ((1 - share) * r @ g[i] - share * cloud.phi[i]) / s**2 * w
    return lap


def second_order(cloud):
    """2/n0 sum_j W (phi_j - phi_i) (C_3 + C_4) p/(l0 r), in 3D C_4 + C_5 + C_6: the fit with W l0^2/r^2."""
    return np.array([2 / cloud.l0**2 * taylor(cloud, i)[cloud.d : 2 * cloud.d].sum() for i in range(len(cloud))])


def least_squares(cloud):
    """The second derivatives of the fit with W (LSMPS type A)."""
    return np.array([2 / cloud.l0**2 * taylor(cloud, i, False)[cloud.d : 2 * cloud.d].sum() for i in range(len(cloud))])
