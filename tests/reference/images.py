"""The images beyond a free surface: their vector b_i and the distance delta_i of the surface, without walls."""

from itertools import product
from math import log

import numpy as np


def flat(cloud, stretch=1.0):
    """l0 n . s and (n . M n)/(l0 n . s) of a row on the flat surface of a lattice, drawn apart along n, n inward."""
    d, re = cloud.d, cloud.re / cloud.l0
    lean = square = 0.0
    for cell in product(range(-4, 5), repeat=d):
        r = np.array(cell) * np.append([stretch ** (-1 / (d - 1))] * (d - 1), stretch)
        s = np.linalg.norm(r)
        if 0 < s < re and r[-1] <= 0:
            lean -= d / cloud.n0 * cloud.W(s, re) * r[-1] / s**2
            square += d / cloud.n0 * cloud.W(s, re) * r[-1] ** 2 / s**2
    return lean, square / lean


def images(cloud):
    """b_i = s_i = d/n0 sum_j W r/r^2, and delta_i: the mean over i and its neighbours of l0/2 (q/q of the lattice)^p.

    q = (b . M b + 0.05 of the flat surface)/(b . s + likewise), b of length one, M = d/n0 sum_j W r (x) r/r^2;
    the power to second order in q/q - 1, p from how q grows with the stretch of a flat surface. Between l0/4 and
    3 l0/4; the weights of the mean are theta W of the neighbours and W(l0) of i.
    """
    lean, usual = flat(cloud)
    power = log(1.02 / 0.98) / log(flat(cloud, 1.02)[1] / flat(cloud, 0.98)[1])
    b, own, delta = cloud.vectors(), cloud.scalars(), cloud.scalars()
    for i in range(len(cloud)):
        moment = np.zeros((cloud.d, cloud.d))
        for _, r, s, w in cloud.neighbours(i):
            b[i] += cloud.d / cloud.n0 * w * r / s**2
            moment += cloud.d / cloud.n0 * w * np.outer(r, r) / s**2
        n, little = b[i] / np.linalg.norm(b[i]), 0.05 * lean / cloud.l0
        q = (n @ moment @ n + little * usual * cloud.l0) / (b[i] @ n + little)
        x = q / (usual * cloud.l0) - 1
        own[i] = cloud.l0 * min(max(0.5 * (1 + power * x + power * (power - 1) / 2 * x**2), 0.25), 0.75)
    nearest = cloud.W(cloud.l0, cloud.re)
    for i in range(len(cloud)):
        around = [(w * cloud.share[j], own[j]) for j, _, _, w in cloud.neighbours(i)]
        delta[i] = nearest * own[i] + sum(w * x for w, x in around)
        delta[i] /= nearest + sum(w for w, _ in around)
    return b, delta


def density(cloud, delta, b):
    """What the images add to n: sum_j theta_j W(|r_ij - 2 delta_j b_j/|b_j||), and theta_i W(2 delta_i)."""
    total = cloud.scalars()
    for i in range(len(cloud)):
        if 2 * delta[i] < cloud.re:
            total[i] += cloud.share[i] * cloud.W(2 * delta[i], cloud.re)
        for j, r, _, _ in cloud.neighbours(i):
            s = np.linalg.norm(r - 2 * delta[j] * b[j] / np.linalg.norm(b[j]))
            if s < cloud.re:
                total[i] += cloud.share[j] * cloud.W(s, cloud.re)
    return total
