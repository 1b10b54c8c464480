"""Right sides S of div(grad(P)/rho) = S, with the time step dt = 0.02 s, n and div u of the original models."""

from reference.divergence import original as divergence_of
from reference.number_density import original as number_density

DT = 0.02
DT_BEFORE = 0.016


def density(cloud):
    """-(n - n0)/(n0 dt^2)."""
    return -(number_density(cloud) - cloud.n0) / (cloud.n0 * DT**2)


def divergence(cloud):
    """div(u)/dt."""
    return divergence_of(cloud) / DT


def divergence_density(cloud, gamma=0.05):
    """div(u)/dt + gamma (n0 - n)/(n0 dt^2), the second times 1 - theta where it is positive."""
    error = (cloud.n0 - number_density(cloud)) / cloud.n0
    error[error > 0] *= 1 - cloud.share[error > 0]
    return divergence_of(cloud) / DT + gamma * error / DT**2


def rate(cloud, u):
    """Dn/Dt = sum_j W' r_ij . u_ij/r = -sum_j re/r^3 r_ij . u_ij."""
    change = cloud.scalars()
    for i in range(len(cloud)):
        for j, r, s, _ in cloud.neighbours(i):
            change[i] -= cloud.re / s**3 * (u[j] - u[i]) @ r
    return change
