"""Particle number densities."""


def original(cloud):
    """n_i = sum_j W(r_ij, re)."""
    n = cloud.scalars()
    for i in range(len(cloud)):
        for _, _, _, w in cloud.neighbours(i):
            n[i] += w
    return n
