"""The divergence model of the original method."""

from typing import ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs, pair_sum, pair_term
from spume.particles import FLUID, WALL, Particles
from spume.schemes.divergence.base import Divergence, mirrored


def _scaled(a, total, scale, mirror):  # type: ignore[no-untyped-def]
    return total * scale


@pair_term(reads=("velocity", "kind", "to_surface"), finish=_scaled)
def approach(a, b, r, w, scale, mirror):  # type: ignore[no-untyped-def]
    difference = mirrored(a, b, mirror)
    return difference.dot(r) * w / r.dot(r)


class Original(Divergence, name="original"):
    """<div u>_i = d/n0 sum_j (u_j - u_i) . r_ij/r^2 W (review Eq. 4 with its missing sum).

    Exact for linear fields on the regular arrangement, for constants on any.
    """

    ids: ClassVar = ("A3",)
    reference: ClassVar = "koshizuka1996"
    order: ClassVar = 0

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, out: str, mirror: bool = False) -> None:
        """Write the divergence of ``velocity`` [1/s] at fluid and wall rows into ``out``."""
        pair_sum(
            approach, particles, pairs, out=out, weight=self.weight, re=self.radius(lattice), rows=FLUID | WALL,
            arguments=(lattice.dimension / self.n0(lattice), float(mirror)),
        )  # fmt: skip
