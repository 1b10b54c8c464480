"""The velocity's gradient, exact for linear fields, and what it says of the volume over a step."""

from spume.lattice import Lattice
from spume.pairs import Pairs, PairSum, pair_sums, pair_term, row_map, row_term
from spume.particles import FLUID, WALL, Field, Particles
from spume.schemes.correction import (
    along_normal,
    floored_inverse,
    second_moment_sum,
    symmetric_matrix,
    wall_moment_sum,
)
from spume.schemes.divergence.base import Divergence, mirrored

FLOOR = 0.6
"""Least eigenvalue of the matrix that is inverted [1]."""

VELOCITY_GRADIENT = Field(
    "predicted_gradient", ("d", "d"), "1/s", "gradient of the predicted velocity", scratch="correction"
)


def _corrected(a, total, scale, mirror, floor, normals):  # type: ignore[no-untyped-def]
    return scale * total @ floored_inverse(scale * symmetric_matrix(a.second_moment - normals * a.wall_moment), floor)


@pair_term(
    reads=("velocity", "kind", "to_surface", "second_moment", "wall_moment"), shape=("d", "d"), finish=_corrected
)
def spread(a, b, r, w, scale, mirror, floor, normals):  # type: ignore[no-untyped-def]
    return mirrored(a, b, mirror).outer_product(along_normal(b, r, normals)) * (w / r.dot(r))


@row_term(reads=("source", "predicted_gradient", "surface_share"))
def less_turning(a, share):  # type: ignore[no-untyped-def]
    return a.source - 0.5 * share * (1.0 - a.surface_share) * (a.predicted_gradient @ a.predicted_gradient).trace()


def velocity_gradient(
    operator: Divergence, lattice: Lattice, particles: Particles, pairs: Pairs, mirror: bool, floor: float = FLOOR
) -> None:
    """Write ``predicted_gradient``, (grad u)_ab = d u_a/d x_b = d/n0 sum_j (u_j - u_i)_a (C_i r_ij)_b W/r^2 [1/s].

    C_i = M_i^-1, the eigenvalues of M_i raised to ``floor`` at least. Near the surface too: a flat one leaves the
    smallest eigenvalue at 0.5, which a floor up to that does not touch.

    Args:
        operator: gives weight and effective radius, and says with ``of_normals`` that n n . r_ij stands in the place
            of r_ij towards a mirror image, here and in M_i: such an image moves along the normal n of its wall, and how
            the velocity changes along the wall is the fluid's to say.
        mirror: see ``Divergence``; wall rows then have none.
        floor: least eigenvalue of the inverse of C; another than the divergence's means a second pass.
    """
    pair_sums((velocity_gradient_sum(operator, lattice, particles, pairs, mirror, floor),), particles, pairs)


def velocity_gradient_sum(
    operator: Divergence, lattice: Lattice, particles: Particles, pairs: Pairs, mirror: bool, floor: float
) -> PairSum:
    """Return the sum that `velocity_gradient` makes, having made the second moment that it needs."""
    rows = FLUID if mirror else FLUID | WALL
    pair_sums((second_moment_sum(operator, lattice, rows=rows),), particles, pairs)
    normals = mirror and operator.of_normals
    if normals:
        pair_sums((wall_moment_sum(operator, lattice),), particles, pairs)
    return PairSum(
        (spread,), ("predicted_gradient",), operator.weight, operator.radius(lattice), rows,
        arguments=(lattice.dimension / operator.n0(lattice), float(mirror), floor, float(normals)),
    )  # fmt: skip


def keep_volume(
    operator: Divergence, lattice: Lattice, particles: Particles, pairs: Pairs, mirror: bool, share: float = 1.0
) -> None:
    """Take 1/2 tr((grad u)^2) off ``source``, so that a step keeps the volume to second order.

    r + dt u has the volume det(I + dt grad u) = 1 + dt div u - dt^2/2 tr((grad u)^2) + ... with div u = O(dt): it stays
    where div u^(k+1) = dt/2 tr((grad u)^2), not where div u^(k+1) = 0. The same term makes the projection one of
    second order: with div u^(k+1) = 0 at r^k each step takes dt^2 |grad P/rho|^2/2 off the kinetic energy, and a
    particle on a circle spirals out. It fades out towards the free surface. (This project.)

    Args:
        operator: see `velocity_gradient`, as for ``mirror``.
        share: dt divided by the time over which the source makes up for the divergence.
    """
    velocity_gradient(operator, lattice, particles, pairs, mirror)
    row_map(less_turning, particles, out="source", rows=FLUID, arguments=(share,))
