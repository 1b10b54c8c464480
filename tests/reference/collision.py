"""Changes of velocity by collisions."""


def none(cloud):
    """No change."""
    return cloud.vectors()


def inelastic(cloud, distance=0.5, restitution=0.2):
    """(1 + e) m_j/(m_i + m_j) min(u_ij . r_ij, 0)/r^2 r_ij for pairs nearer than ``distance`` l0."""
    change = cloud.vectors()
    for i in range(len(cloud)):
        for j, r, s, _ in cloud.neighbours(i, distance * cloud.l0):
            share = cloud.rho[j] / (cloud.rho[i] + cloud.rho[j])
            change[i] += (1 + restitution) * share * min((cloud.u[j] - cloud.u[i]) @ r, 0.0) / s**2 * r
    return change
