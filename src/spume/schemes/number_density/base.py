"""Particle number density n_i = sum_j W(r_ij, re)."""

from typing import ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs, pair_sum, pair_term
from spume.particles import FLUID, WALL, Particles
from spume.schemes.operator import Operator


@pair_term()
def weight_of_pair(a, b, r, w):  # type: ignore[no-untyped-def]
    return w


class NumberDensity(Operator, family="number_density"):
    """How crowded the surroundings of a row are; n = n0 on the regular arrangement."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs) -> None:
        """Write ``number_density`` of fluid and wall rows."""
        raise NotImplementedError


class Original(NumberDensity, name="original"):
    """n_i = sum_j W(r_ij, re) over rows of every kind (Koshizuka & Oka 1996)."""

    ids: ClassVar = ("A2",)
    reference: ClassVar = "koshizuka1996"

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs) -> None:
        """Write ``number_density`` of fluid and wall rows."""
        pair_sum(
            weight_of_pair, particles, pairs, out="number_density", weight=self.weight,
            re=self.radius(lattice), rows=FLUID | WALL,
        )  # fmt: skip
