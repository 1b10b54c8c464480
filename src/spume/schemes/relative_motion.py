"""How fast neighbours move against each other, which is what changes the arrangement of particles."""

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, pair_max, pair_term
from spume.particles import FLUID, Field, Particles
from spume.schemes.operator import Operator

RELATIVE_MOTION = Field("relative_motion", (), "m^2/s^2", "largest squared relative speed of a row and a neighbour")


@pair_term(reads=("velocity", "kind", "to_surface"))
def squared_relative_speed(a, b, r, w):  # type: ignore[no-untyped-def]
    difference = b.velocity - a.velocity
    # What slides along a wall meets the same wall a spacing later.
    towards = difference.dot(b.to_surface.normalized(1e-30))
    return kernels.qd.select(b.kind == FLUID, difference.norm_sqr(), towards * towards)


def relative_motion(operator: Operator, lattice: Lattice, particles: Particles, pairs: Pairs) -> None:
    """Write ``relative_motion`` = max_j |u_j - u_i|^2 [m^2/s^2] of fluid rows; against walls, of the normal part.

    It is made once for a velocity: that rows are shifted by a small part of a spacing afterwards changes no velocity.

    Args:
        operator: gives the effective radius.
    """
    recipe = (operator.re,)
    if particles.keeps("relative_motion", recipe, ("velocity",)):
        return
    pair_max(
        squared_relative_speed, particles, pairs, out="relative_motion", weight=operator.weight,
        re=operator.radius(lattice),
    )  # fmt: skip
    particles.keep("relative_motion", recipe, ("velocity",))
