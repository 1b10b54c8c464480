"""How fast neighbours move against each other, which is what changes the arrangement of particles."""

from typing import Any

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, pair_max, pair_term
from spume.particles import FLUID, Field, Particles
from spume.schemes.operator import Operator

RELATIVE_MOTION = (
    Field("relative_motion", (), "m^2/s^2", "largest squared relative speed of a row and a neighbour"),
    Field("surrounded_motion", (), "m^2/s^2", "the same, each pair counted as much as both of it are surrounded"),
)


@kernels.func
def squared_relative_speed(a, b):  # type: ignore[no-untyped-def]
    difference = b.velocity - a.velocity
    # What slides along a wall meets the same wall a spacing later.
    towards = difference.dot(b.to_surface.normalized(1e-30))
    return kernels.qd.select(b.kind == FLUID, difference.norm_sqr(), towards * towards)


@pair_term(reads=("velocity", "kind", "to_surface"))
def of_all(a, b, r, w, n0):  # type: ignore[no-untyped-def]
    return squared_relative_speed(a, b)


@pair_term(reads=("velocity", "kind", "to_surface", "number_density"))
def of_surrounded(a, b, r, w, n0):  # type: ignore[no-untyped-def]
    n = kernels.qd.select(b.kind == FLUID, min(a.number_density, b.number_density), a.number_density)
    share = min(n / n0, 1.0)
    return share * share * squared_relative_speed(a, b)


def relative_motion(
    operator: Operator, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any
) -> None:
    """Write the fields of ``RELATIVE_MOTION`` of fluid rows [m^2/s^2]; against walls they are of the normal part.

    ``relative_motion`` is max_j |u_j - u_i|^2; ``surrounded_motion`` is max_j (s |u_j - u_i|)^2 with
    s = min(n_i, n_j, n0)/n0. Drops that fly past each other change no arrangement that a pressure is solved for, and in
    spray they do so faster than anything in the water.

    They are made once for a velocity: shifting rows by a small part of a spacing afterwards changes no velocity.

    Args:
        operator: gives the effective radius.
        number_density: the model whose n0 is that of the field ``number_density``.
    """
    recipe = (operator.re,)
    names = [field.name for field in RELATIVE_MOTION]
    if all(particles.keeps(name, recipe, ("velocity",)) for name in names):
        return
    pair_max(
        (of_all, of_surrounded), particles, pairs, out=names, weight=operator.weight,
        re=operator.radius(lattice), arguments=(number_density.n0(lattice),),
    )  # fmt: skip
    for name in names:
        particles.keep(name, recipe, ("velocity",))
