"""Displacements by particle shifting; the rows beyond x = 1.5 l0 are taken for the free surface."""

import numpy as np

from reference.cloud import DT
from reference.gradient import matrix

INNER, VICINITY, SURFACE, SPLASH = range(4)


def none(cloud):
    """No displacement."""
    return cloud.vectors()


def limited(vector, largest):
    """A vector, no longer than ``largest``."""
    return vector * min(1.0, largest / max(np.linalg.norm(vector), 1e-30))


def crowding(cloud, i, tensile=0.0):
    """Gradient of the concentration: d/n0 sum_j [1 + R (W/W(l0))^4] W r_ij/r^2."""
    total = np.zeros(cloud.d)
    for _, r, s, w in cloud.neighbours(i):
        total += cloud.d / cloud.n0 * (1 + tensile * (w / cloud.W(cloud.l0, cloud.re)) ** 4) * w * r / s**2
    return total


def normal(cloud, i):
    """-B^-1 b/|B^-1 b|, b = sum_j v r_ij, B = sum_j v r_ij (x) r_ij, v = (1 - r/re)^2: points out of the fluid."""
    b, B = np.zeros(cloud.d), np.zeros((cloud.d, cloud.d))
    for _, r, s, _ in cloud.neighbours(i):
        b += (1 - s / cloud.re) ** 2 * r
        B += (1 - s / cloud.re) ** 2 * np.outer(r, r)
    outward = -np.linalg.solve(B, b)
    return outward / np.linalg.norm(outward)


def class_of(cloud, i):
    """Splash: surface rows without another kind of neighbour; vicinity: rows with a neighbour on the surface."""
    flags = [cloud.share[j] > 0.5 for j, *_ in cloud.neighbours(i)]
    if cloud.share[i] > 0.5:
        return SPLASH if all(flags) else SURFACE
    return VICINITY if any(flags) else INNER


def fickian(cloud, strength=0.1, largest=0.1):
    """-(1 - theta) A l0^2 grad c, at most ``largest`` l0 long."""
    shift = cloud.vectors()
    for i in range(len(cloud)):
        step = -(1 - cloud.share[i]) * strength * cloud.l0**2 * crowding(cloud, i)
        shift[i] = limited(step, largest * cloud.l0)
    return shift


def fickian_along_surface(cloud, strength=0.1, largest=0.1, spray=0.5, supported=0.65, relative=6.5):
    """-D [(1 - theta) I + theta beta (I - n n)] grad c; beta falls from 1 to 0 between 0.65 and 0.5 n0.

    D = A l0^2, or ``relative`` l0 max_j |u_j - u_i| dt where that is less.
    """
    shift = cloud.vectors()
    for i in range(len(cloud)):
        g, n, theta = crowding(cloud, i), normal(cloud, i), cloud.share[i]
        ratio = sum(w for *_, w in cloud.neighbours(i)) / cloud.n0
        beta = min(max((ratio - spray) / (supported - spray), 0.0), 1.0)
        step = (1 - theta) * g + theta * beta * (g - (n @ g) * n)
        fastest = max((np.linalg.norm(cloud.u[j] - cloud.u[i]) for j, *_ in cloud.neighbours(i)), default=0.0)
        D = min(strength * cloud.l0**2, relative * cloud.l0 * fastest * DT)
        shift[i] = limited(-D * step, largest * cloud.l0)
    return shift


def fickian_carried(cloud):
    """Velocity and pressure [kPa] at the shifted place: phi_i + d/n0 sum_j (phi_j - phi_i) r_ij . C_i dr_i/r^2 W."""
    carried = np.column_stack([cloud.u, cloud.phi / 1000])
    shift = fickian(cloud)
    for i in range(len(cloud)):
        way = matrix(cloud, i) @ shift[i]
        for j, r, s, w in cloud.neighbours(i):
            change = np.append(cloud.u[j] - cloud.u[i], (cloud.phi[j] - cloud.phi[i]) / 1000)
            carried[i] += cloud.d / cloud.n0 * change * (r @ way) / s**2 * w
    return carried


def fickian_surface(cloud, strength=0.1, tensile=0.2, normal_share=0.0, largest=0.1):
    """-A l0^2 [(I - n n) . grad c + alpha_n (n . grad c - beta) n] near the surface, -A l0^2 grad c inside."""
    shift, level = cloud.vectors(), flat(cloud, tensile)
    for i in range(len(cloud)):
        g, kind = crowding(cloud, i, tensile), class_of(cloud, i)
        if kind != INNER:
            n = normal(cloud, i)
            across = normal_share * (n @ g - level) if kind in (SURFACE, SPLASH) else 0.0
            g = g - (n @ g) * n + across * n
        shift[i] = limited(-strength * cloud.l0**2 * g, largest * cloud.l0)
    return shift


def flat(cloud, tensile):
    """n . grad c of a row on the flat surface of the undisturbed lattice."""
    total = 0.0
    for cell in np.ndindex(*[7] * cloud.d):
        r = cloud.l0 * (np.array(cell) - 3)
        s = np.linalg.norm(r)
        if 0 < s < cloud.re and r[-1] <= 0:
            w = cloud.W(s, cloud.re)
            total += cloud.d / cloud.n0 * (1 + tensile * (w / cloud.W(cloud.l0, cloud.re)) ** 4) * w * r[-1] / s**2
    return total


def optimised(cloud, strength=0.5, largest=0.1):
    """-h^2/2 grad c inside, its part along the surface on it and next to it, none for splash; h = re/3."""
    shift = cloud.vectors()
    for i in range(len(cloud)):
        g, kind = crowding(cloud, i), class_of(cloud, i)
        if kind in (VICINITY, SURFACE):
            n = normal(cloud, i)
            g = g - (n @ g) * n
        if kind != SPLASH:
            shift[i] = limited(-strength * (cloud.re / 3) ** 2 * g, largest * cloud.l0)
    return shift


def tangential(cloud, largest=0.1):
    """Optimised, and for surface rows dt^2/rho n n . [grad P - d/n0 sum_j (P_i + P_j)/r^2 r_ij W] besides."""
    return optimised(cloud, largest=largest) + repulsion(cloud, largest)


def tangential_carried(cloud):
    """Velocity, with what the move across the surface is over dt, and pressure [kPa]."""
    return np.column_stack([cloud.u + repulsion(cloud) / DT, cloud.phi / 1000])


def repulsion(cloud, largest=0.1):
    """dt^2/rho n n . [grad P - d/n0 sum_j (P_i + P_j)/r^2 r_ij W] for surface rows."""
    shift = cloud.vectors()
    for i in range(len(cloud)):
        if class_of(cloud, i) == SURFACE:
            n, conservative = normal(cloud, i), np.zeros(cloud.d)
            for j, r, s, w in cloud.neighbours(i):
                conservative += cloud.d / cloud.n0 * (cloud.phi[i] + cloud.phi[j]) / s**2 * r * w
            push = -(DT**2) / cloud.rho[i] * n @ (conservative - cloud.slope[i]) * n
            shift[i] += limited(push, largest * cloud.l0)
    return shift
