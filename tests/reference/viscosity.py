"""Viscous accelerations."""


def explicit(cloud):
    """2 d/(lambda n0) sum_j nu_ij (u_j - u_i) W with nu_ij = 2 nu_i nu_j/(nu_i + nu_j)."""
    a = cloud.vectors()
    for i in range(len(cloud)):
        for j, _, _, w in cloud.neighbours(i):
            nu = 2 * cloud.nu[i] * cloud.nu[j] / (cloud.nu[i] + cloud.nu[j])
            a[i] += 2 * cloud.d / (cloud.lambda_ * cloud.n0) * nu * (cloud.u[j] - cloud.u[i]) * w
    return a


def none(cloud):
    """No acceleration."""
    return cloud.vectors()
