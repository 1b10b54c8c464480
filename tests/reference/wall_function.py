"""Viscous accelerations beside walls whose stress is given."""

import numpy as np

from reference.collision import walls
from reference.viscosity import shared, slipping


def thin(cloud):
    """Return kinematic viscosities [m^2/s] for both branches: every third row has a hundred-thousandth of its own."""
    return cloud.nu * np.where(np.arange(len(cloud)) % 3 == 0, 1e-5, 1.0)


def none(cloud):
    """The Laplacian over all rows; solid ones have the viscosity of the row that sees them."""
    return _accelerated(cloud, lambda i, j, r: cloud.rho[i] * thin(cloud)[i] * (cloud.u[j] - cloud.u[i]))


def power_law(cloud):
    """A solid row j takes the stress tau off i: mu (u_j - u_i) becomes -tau h t.

    t is the direction of the velocity along the wall, h the distance of i from the plane through j, y = h - depth its
    distance to the wall's surface, at least a quarter of the depth of j behind it; behind the surface nothing. With
    the friction velocity v: u/v = v y/nu for v y/nu < 11.81, else 8.3 (v y/nu)^(1/7). Every fourth row is on a
    free-slip wall.
    """
    _, to_surface = walls(cloud)
    slip, u_wall, nu = slipping(cloud), cloud.u_before, thin(cloud)

    def flux(i, j, r):
        depth = np.linalg.norm(to_surface[j])
        n = to_surface[j] / depth
        h = -r @ n
        along = (cloud.u[i] - u_wall[j]) - ((cloud.u[i] - u_wall[j]) @ n) * n
        u = np.linalg.norm(along)
        if slip[j] or h <= depth:
            return 0 * along
        y = max(h - depth, depth / 4)
        v = np.sqrt(nu[i] * u / y)
        if v * y / nu[i] > 8.3 ** (7 / 6):
            v = (u / 8.3) ** (7 / 8) * (nu[i] / y) ** (1 / 8)
        return -cloud.rho[i] * v**2 * h * along / u

    return _accelerated(cloud, flux)


def _accelerated(cloud, at_wall):
    """1/rho_i 2 d/(lambda n0) sum_j f_ij W of fluid rows, f = mu_ij (u_j - u_i) between two of them."""
    solid, _ = walls(cloud)
    a, thinner = cloud.vectors(), cloud.moved(cloud.x)
    thinner.nu = thin(cloud)
    for i in np.flatnonzero(~solid):
        for j, r, _, w in cloud.neighbours(i):
            f = at_wall(i, j, r) if solid[j] else shared(thinner, i, j) * (cloud.u[j] - cloud.u[i])
            a[i] += 2 * cloud.d / (cloud.lambda_ * cloud.n0) * w * f / cloud.rho[i]
    return a
