"""Particle number density n_i = sum_j W(r_ij, re)."""

from typing import ClassVar

from spume.kernels import qd
from spume.lattice import Lattice
from spume.pairs import Pairs, PairSum, pair_sums, pair_term
from spume.particles import FLUID, WALL, Field, Particles
from spume.schemes.operator import Operator

SOLID_DENSITY = Field("solid_density", (), "1", "part of the number density that solid rows bring")


@pair_term()
def weight_of_pair(a, b, r, w):  # type: ignore[no-untyped-def]
    return w


@pair_term(reads=("kind",))
def weight_of_solid(a, b, r, w):  # type: ignore[no-untyped-def]
    return qd.select(b.kind == FLUID, 0.0, w)


class NumberDensity(Operator, family="number_density"):
    """How crowded the surroundings of a row are; n = n0 on the regular arrangement."""

    needs: ClassVar[tuple[Field, ...]] = (SOLID_DENSITY,)

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs) -> None:
        """Write ``number_density`` of fluid and wall rows, and what solid rows bring to it."""
        raise NotImplementedError


class Original(NumberDensity, name="original"):
    """n_i = sum_j W(r_ij, re) over rows of every kind (Koshizuka & Oka 1996)."""

    ids: ClassVar = ("A2",)
    reference: ClassVar = "koshizuka1996"

    def sums(self, lattice: Lattice) -> tuple[PairSum, ...]:
        """Return the sum of the weights, and that of solid rows alone."""
        terms, out = (weight_of_pair, weight_of_solid), ("number_density", SOLID_DENSITY.name)
        return (PairSum(terms, out, self.weight, self.radius(lattice), rows=FLUID | WALL),)

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs) -> None:
        """Write ``number_density`` of fluid and wall rows, and what solid rows bring to it."""
        pair_sums(self.sums(lattice), particles, pairs)
