"""Changes of velocity by collisions."""

import numpy as np

from reference.cloud import DT


def none(cloud):
    """No change."""
    return cloud.vectors()


def met(cloud, i, j, r):
    """Direction in which two fluid rows met."""
    before = r - DT * (cloud.u[j] - cloud.u[i])
    along = before if before @ r < 0 else r
    return along / np.linalg.norm(along)


def inelastic(cloud, distance=0.5, restitution=0.2):
    """(1 + e) m_j/(m_i + m_j) min(u_ij . e_ij, 0) e_ij for pairs nearer than ``distance`` l0.

    e_ij is the direction of the pair, at the start of the step if it points the other way at the end.
    """
    change = cloud.vectors()
    for i in range(len(cloud)):
        for j, r, _, _ in cloud.neighbours(i, distance * cloud.l0):
            share = cloud.rho[j] / (cloud.rho[i] + cloud.rho[j])
            e = met(cloud, i, j, r)
            change[i] += (1 + restitution) * share * min((cloud.u[j] - cloud.u[i]) @ e, 0.0) * e
    return change


def walls(cloud):
    """Which rows are solid, the vectors from them to the surface of their wall."""
    return cloud.share > 0.6, 0.4 * cloud.l0 * cloud.slope / np.linalg.norm(cloud.slope, axis=1)[:, None]


def inelastic_at_wall(cloud, distance=0.5, restitution=0.2):
    """Changes of velocity and, over dt, of position, and the number of collisions, where some rows are solid.

    A solid row is met like a fluid one of infinite mass if it is nearer than ``distance`` l0 and is seen from beside
    its face, at more than 45 degrees from the normal n. Else its face stops what lies behind it, that is farther than
    distance l0 - l0/2 in front of it, in the part of the face that belongs to the row: aside by less than 0.54 l0
    (in 3D by that times the root of two); the mean over the faces that a row touches.
    """
    solid, to_surface = walls(cloud)
    change, count = cloud.vectors(), cloud.scalars()
    for i in np.flatnonzero(~solid):
        faces, from_faces = 0, np.zeros(cloud.d)
        for j, r, s, _ in cloud.neighbours(i, cloud.l0):
            depth = np.linalg.norm(to_surface[j])
            n, approach = to_surface[j] / depth, cloud.u[j] - cloud.u[i]
            beside = not solid[j] or abs(r @ n) < s / 2**0.5
            if s < distance * cloud.l0 and beside:
                share = 1.0 if solid[j] else cloud.rho[j] / (cloud.rho[i] + cloud.rho[j])
                e = r / s if solid[j] else met(cloud, i, j, r)
                change[i] += (1 + restitution) * share * min(approach @ e, 0.0) * e
                count[i] += approach @ e < 0
            elif (
                solid[j]
                and r @ n + depth > (0.5 - distance) * cloud.l0
                and s**2 - (r @ n) ** 2 < (cloud.d - 1) * (0.54 * cloud.l0) ** 2
            ):
                faces += 1
                from_faces += (1 + restitution) * max(approach @ n, 0.0) * n
                count[i] += approach @ n > 0
        change[i] += from_faces / max(faces, 1)
    return np.column_stack([change, change, count])
