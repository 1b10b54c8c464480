"""Right sides S of div(grad(P)/rho) = S, with n and div u of the original models.

The cloud holds the instant *. ``before`` are its positions at k-1 and k, ``u_before`` its velocities at k.
"""

from reference.cloud import DT, DT_BEFORE
from reference.divergence import original as divergence_of
from reference.number_density import original as density_of


def density(cloud):
    """-(n - n0)/(n0 dt^2)."""
    return -(density_of(cloud) - cloud.n0) / (cloud.n0 * DT**2)


def divergence(cloud):
    """div(u)/dt."""
    return divergence_of(cloud) / DT


def divergence_density(cloud, gamma=0.05):
    """div(u)/dt + gamma (n0 - n)/(n0 dt^2), the second times 1 - theta where it is positive."""
    return divergence_of(cloud) / DT - gamma * error(cloud, density_of(cloud)) / DT**2


def divergence_density_smoothed(cloud, gamma=0.05):
    """The same with the mean (e_i + sum_j W e_j)/(1 + sum_j W) in place of the error e_i."""
    e, mean = error(cloud, density_of(cloud)), cloud.scalars()
    for i in range(len(cloud)):
        around = [(w, e[j]) for j, _, _, w in cloud.neighbours(i)]
        mean[i] = (e[i] + sum(w * x for w, x in around)) / (1 + sum(w for w, _ in around))
    return divergence_of(cloud) / DT - gamma * mean / DT**2


def error(cloud, n):
    """(n - n0)/n0, where neighbours are missing at the surface times 1 - theta."""
    e = (n - cloud.n0) / cloud.n0
    e[e < 0] *= 1 - cloud.share[e < 0]
    return e


def rate(cloud):
    """Dn/Dt = sum_j W' r_ij . u_ij/r = -sum_j re/r^3 r_ij . u_ij for W = re/r - 1."""
    change = cloud.scalars()
    for i in range(len(cloud)):
        for j, r, s, _ in cloud.neighbours(i):
            change[i] -= cloud.re / s**3 * (cloud.u[j] - cloud.u[i]) @ r
    return change


def higher_order(cloud):
    """-(Dn/Dt)*/(n0 dt)."""
    return -rate(cloud) / (cloud.n0 * DT)


def three_term(cloud, alpha=0.2, beta=0.05):
    """-1/(n0 dt) {(n* - n^k)/dt - (n^k - n^(k-1))/dt' + alpha (n^k - n^(k-1))/dt' + beta (n^k - n0)/dt}."""
    first, start = (density_of(cloud.moved(x)) for x in cloud.before)
    change = (start - first) / DT_BEFORE
    total = (density_of(cloud) - start) / DT - change + alpha * change + beta * cloud.n0 * error(cloud, start) / DT
    return -total / (cloud.n0 * DT)


def error_compensating(cloud):
    """-1/dt {(Dn/Dt)*/n0 + |e| (Dn/Dt)^k/n0 + |dt (Dn/Dt)^k/n0| e/dt}, e = (n^k - n0)/n0."""
    start = cloud.moved(cloud.before[1], cloud.u_before)
    e, change = error(cloud, density_of(start)), rate(start)
    return -(rate(cloud) / cloud.n0 + abs(e) * change / cloud.n0 + abs(DT * change / cloud.n0) * e / DT) / DT
