"""Gradients of ``phi``."""

import numpy as np

from reference.cloud import DT
from reference.images import images


def least(cloud, i):
    """Smallest phi of a row and its neighbours."""
    return min(cloud.phi[i], *(cloud.phi[j] for j, *_ in cloud.neighbours(i)))


def matrix(cloud, i):
    """C_i = [d/n0 sum_j W r (x) r/r^2]^-1."""
    moment = np.zeros((cloud.d, cloud.d))
    for _, r, s, w in cloud.neighbours(i):
        moment += cloud.d / cloud.n0 * w * np.outer(r, r) / s**2
    return np.linalg.inv(moment)


def original(cloud):
    """d/n0 sum_j (phi_j - phi_i)/r^2 r_ij W."""
    g = cloud.vectors()
    for i in range(len(cloud)):
        for j, r, s, w in cloud.neighbours(i):
            g[i] += cloud.d / cloud.n0 * (cloud.phi[j] - cloud.phi[i]) / s**2 * r * w
    return g


def minimum(cloud):
    """d/n0 sum_j (phi_j - phimin_i)/r^2 r_ij W."""
    g = cloud.vectors()
    for i in range(len(cloud)):
        lowest = least(cloud, i)
        for j, r, s, w in cloud.neighbours(i):
            g[i] += cloud.d / cloud.n0 * (cloud.phi[j] - lowest) / s**2 * r * w
    return g


def cmps(cloud):
    """d/n0 sum_j [(phi_i + phi_j) - (phimin_i + phimin_j)]/r^2 r_ij W."""
    g = cloud.vectors()
    lowest = [least(cloud, i) for i in range(len(cloud))]
    for i in range(len(cloud)):
        for j, r, s, w in cloud.neighbours(i):
            pair = (cloud.phi[i] + cloud.phi[j]) - (lowest[i] + lowest[j])
            g[i] += cloud.d / cloud.n0 * pair / s**2 * r * w
    return g


def sum_(cloud):
    """d/n0 sum_j (phi_j + phi_i)/r^2 r_ij W."""
    g = cloud.vectors()
    for i in range(len(cloud)):
        for j, r, s, w in cloud.neighbours(i):
            g[i] += cloud.d / cloud.n0 * (cloud.phi[j] + cloud.phi[i]) / s**2 * r * w
    return g


def corrected_published(cloud):
    """d/n0 sum_j (phi_j - phi_i)/r^2 C_i r_ij W with C_i = [1/n_i sum_j W r (x) r/r^2]^-1."""
    g = cloud.vectors()
    for i in range(len(cloud)):
        n = sum(w for *_, w in cloud.neighbours(i))
        C = np.linalg.inv(sum(w * np.outer(r, r) / s**2 / n for _, r, s, w in cloud.neighbours(i)))
        for j, r, s, w in cloud.neighbours(i):
            g[i] += cloud.d / cloud.n0 * (cloud.phi[j] - cloud.phi[i]) / s**2 * (C @ r) * w
    return g


def corrected(cloud):
    """d/n0 sum_j (phi_j - phi_i)/r^2 C_i r_ij W."""
    g = cloud.vectors()
    for i in range(len(cloud)):
        C = matrix(cloud, i)
        for j, r, s, w in cloud.neighbours(i):
            g[i] += cloud.d / cloud.n0 * (cloud.phi[j] - cloud.phi[i]) / s**2 * (C @ r) * w
    return g


def corrected_minimum(cloud):
    """d/n0 sum_j (phi_j - phimin_i)/r^2 C_i r_ij W."""
    g = cloud.vectors()
    for i in range(len(cloud)):
        C, lowest = matrix(cloud, i), least(cloud, i)
        for j, r, s, w in cloud.neighbours(i):
            g[i] += cloud.d / cloud.n0 * (cloud.phi[j] - lowest) / s**2 * (C @ r) * w
    return g


def basis(r, l0):
    """x, y, x^2, y^2, xy of r/l0, in 3D x, y, z, x^2, y^2, z^2, xy, yz, zx."""
    q = r / l0
    return np.array([*q, *q**2, q[0] * q[1], *([q[1] * q[2], q[2] * q[0]] if len(q) == 3 else [])])


def taylor(cloud, i, inverse_square=True):
    """The derivatives D, per l0 and 2/l0^2, that minimise sum_j v (phi_j - phi_i - q . D)^2, q = monomials of r/l0.

    v = W l0^2/r^2 (then q l0/r are the p of Eq. 20) or v = W.
    """
    size = 5 if cloud.d == 2 else 9
    moment, right = np.zeros((size, size)), np.zeros(size)
    for j, r, s, w in cloud.neighbours(i):
        q = basis(r, cloud.l0)
        v = w * cloud.l0**2 / s**2 if inverse_square else w
        moment += v * np.outer(q, q)
        right += v * q * (cloud.phi[j] - cloud.phi[i])
    # Rows of the outermost layer may have too few neighbours: they are not compared.
    return np.linalg.lstsq(moment, right, rcond=None)[0]


def second_order(cloud):
    """1/n0 sum_j W (phi_j - phi_i)/r (C_1, C_2) p, C = [1/n0 sum W p p^T]^-1."""
    return np.array([taylor(cloud, i)[: cloud.d] / cloud.l0 for i in range(len(cloud))])


def completed(cloud):
    """d/n0 C_i sum_j (P_j - P_i + 2 theta_i P_i)/r^2 r_ij W, C_i = [M_i + theta_i (I - M_i)]^-1.

    The eigenvalues of the bracket are raised to 0.3 at least.
    """
    g = cloud.vectors()
    for i in range(len(cloud)):
        moment = bounded(np.linalg.inv(matrix(cloud, i)), cloud.share[i])
        for j, r, s, w in cloud.neighbours(i):
            pair = cloud.phi[j] - cloud.phi[i] + 2 * cloud.share[i] * cloud.phi[i]
            g[i] += cloud.d / cloud.n0 * pair / s**2 * np.linalg.solve(moment, r) * w
    return g


def bounded(moment, share):
    """M + theta (I - M), with the smallest eigenvalue raised to 0.3 if it is less."""
    moment = moment + share * (np.eye(len(moment)) - moment)
    return moment + max(0.3 - np.linalg.eigvalsh(moment)[0], 0.0) * np.eye(len(moment))


def floored(moment, floor):
    """A symmetric matrix, raised by a multiple of I until its least eigenvalue is the floor."""
    return moment + max(floor - np.linalg.eigvalsh(moment)[0], 0.0) * np.eye(len(moment))


def imaged(cloud, floor=0.6):
    """C_i [d/n0 sum_j (phi_j - phi_i) W r/r^2 + 2 theta phi_i b + f rho_i a_i].

    C_i = [M_i + f I + 2 theta delta b (x) b/|b|]^-1. b and delta are those of the images, f I what raises the least
    eigenvalue of the rest to the floor, and a_i the acceleration by all but the pressure, less where phi_i is less than
    rho_i |a_i| l0/4.
    """
    g, (b, delta) = cloud.vectors(), images(cloud)
    for i in range(len(cloud)):
        total, share = np.zeros(cloud.d), cloud.share[i]
        for j, r, distance, w in cloud.neighbours(i):
            total += cloud.d / cloud.n0 * w * (cloud.phi[j] - cloud.phi[i]) * r / distance**2
        weight = cloud.rho[i] * cloud.force[i]
        carried = min(max(cloud.phi[i] / (0.25 * cloud.l0 * np.linalg.norm(weight)), 0.0), 1.0)
        moment = np.linalg.inv(matrix(cloud, i)) + 2 * share * delta[i] * np.outer(b[i], b[i]) / np.linalg.norm(b[i])
        raised = floored(moment, floor)
        at_rest = carried * (raised - moment) @ weight
        g[i] = np.linalg.solve(raised, total + 2 * share * cloud.phi[i] * b[i] + at_rest)
    return g


def cmps_consistent(cloud):
    """d/n0 sum_j [(phi_i + phi_j) - 2 min phi]/r^2 r_ij W with the smallest phi of all rows."""
    g, lowest = cloud.vectors(), cloud.phi.min()
    for i in range(len(cloud)):
        for j, r, s, w in cloud.neighbours(i):
            g[i] += cloud.d / cloud.n0 * (cloud.phi[i] + cloud.phi[j] - 2 * lowest) / s**2 * r * w
    return g


def stabilised(cloud, weighted=True, alpha=0.9):
    """Original gradient + 1/n0 sum_j F_ij W (``weighted``), or + sum_j F_ij, towards a neighbour that comes too near.

    F_ij = rho_i rho_j/(rho_i + rho_j) [sqrt(d^2 - |r_perp|^2) - r_par]/dt^2 e_ij if |r*_ij| < d = alpha l0, with e_ij
    the direction of the pair before the step, r_ij = r*_ij - dt u_ij; r_par and r_perp along and across it.
    """
    g, keep = original(cloud), alpha * cloud.l0
    for i in range(len(cloud)):
        for j, r, s, w in cloud.neighbours(i):
            if s >= keep:
                continue
            start = r - DT * (cloud.u[j] - cloud.u[i])
            e = start / np.linalg.norm(start)
            across = np.linalg.norm(r - (r @ e) * e)
            way = (keep**2 - across**2) ** 0.5 - r @ e
            mass = cloud.rho[i] * cloud.rho[j] / (cloud.rho[i] + cloud.rho[j])
            g[i] += mass * way / DT**2 * e * (w / cloud.n0 if weighted else 1.0)
    return g


def dummy_distance(cloud, size):
    """Distance at which W/r = size, for W = re/r - 1: size r^2 + r - re = 0."""
    return (-1 + (1 + 4 * size * cloud.re) ** 0.5) / (2 * size)


def dummy_neighbour(cloud):
    """d/n0 C~_i [sum_j (P_j - P_i)/r^2 r_ij W + (P_d - P_i)/r_d^2 r_d W_d], C~_i with the dummy's part.

    The dummy balances the surroundings, sum_j W r_ij/r^2 + W_d r_d/r_d^2 = 0. P_d = P_i + r_d . (original gradient)
    inside the fluid and 0 in the open, by the row's share theta.
    """
    g, slope = cloud.vectors(), original(cloud)
    for i in range(len(cloud)):
        lack, moment, total = np.zeros(cloud.d), np.zeros((cloud.d, cloud.d)), np.zeros(cloud.d)
        for j, r, s, w in cloud.neighbours(i):
            lack += w * r / s**2
            moment += w * np.outer(r, r) / s**2
            total += w * (cloud.phi[j] - cloud.phi[i]) * r / s**2
        s = dummy_distance(cloud, np.linalg.norm(lack))
        r, w = -s * lack / np.linalg.norm(lack), cloud.W(s, cloud.re)
        moment += w * np.outer(r, r) / s**2
        share = cloud.share[i]
        total += w * ((1 - share) * r @ slope[i] - share * cloud.phi[i]) * r / s**2
        g[i] = np.linalg.solve(moment, total)  # d/n0 cancels
    return g
