"""Particle number density n_i = sum_j W(r_ij, re)."""

from typing import ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs, PairSum, pair_sums, pair_term
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

    def sums(self, lattice: Lattice) -> tuple[PairSum, ...]:
        """Return the sum of the weights."""
        return (PairSum((weight_of_pair,), ("number_density",), self.weight, self.radius(lattice), rows=FLUID | WALL),)

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs) -> None:
        """Write ``number_density`` of fluid and wall rows."""
        pair_sums(self.sums(lattice), particles, pairs)
