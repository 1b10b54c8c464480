"""The divergence corrected to be exact for linear fields."""

from typing import ClassVar

from pydantic import Field as Parameter

from spume.lattice import Lattice
from spume.pairs import Pairs, pair_sum, pair_term
from spume.particles import ANY, FLUID, WALL, Particles
from spume.schemes.correction import CORRECTION, correction_matrix
from spume.schemes.divergence.base import Divergence, mirrored


def _scaled(a, total, scale, mirror):  # type: ignore[no-untyped-def]
    return total * scale


@pair_term(reads=("velocity", "kind", "to_surface", "correction"), finish=_scaled)
def approach(a, b, r, w, scale, mirror):  # type: ignore[no-untyped-def]
    difference = mirrored(a, b, mirror)
    return difference.dot(a.correction @ r) * w / r.dot(r)


class Corrected(Divergence, name="corrected"):
    """<div u>_i = d/n0 sum_j (u_j - u_i) . C_i r_ij/r^2 W, with the matrix of the corrected gradient.

    Exact for linear velocity fields on any arrangement, so that disorder alone makes no source of pressure.
    """

    reference: ClassVar = "khayyer2011"
    order: ClassVar = 1
    needs: ClassVar = (CORRECTION,)

    largest_condition: float = Parameter(default=1e3, gt=1.0)
    """Largest condition number of the matrix; above it a row falls back to C = I [1]."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, out: str, mirror: bool = False) -> None:
        """Write the divergence of ``velocity`` [1/s] at fluid and wall rows into ``out``."""
        correction_matrix(self, lattice, particles, pairs, ANY, self.largest_condition)
        pair_sum(
            approach, particles, pairs, out=out, weight=self.weight, re=self.radius(lattice), rows=FLUID | WALL,
            arguments=(lattice.dimension / self.n0(lattice), float(mirror)),
        )  # fmt: skip
