"""Corrected inside the fluid, original on the free surface."""

from typing import ClassVar

from pydantic import Field as Parameter

from spume.lattice import Lattice
from spume.pairs import Pairs, pair_sum, pair_term
from spume.particles import ANY, FLUID, WALL, Particles
from spume.schemes.correction import CORRECTION, bounded_correction_matrix
from spume.schemes.divergence.base import Divergence, mirrored
from spume.schemes.free_surface.base import SURFACE_SHARE


def _scaled(a, total, scale, mirror):  # type: ignore[no-untyped-def]
    return total * scale


@pair_term(reads=("velocity", "kind", "to_surface", "correction", "surface_share"), finish=_scaled)
def approach(a, b, r, w, scale, mirror):  # type: ignore[no-untyped-def]
    direction = r + (1.0 - a.surface_share) * (a.correction @ r - r)
    return mirrored(a, b, mirror).dot(direction) * w / r.dot(r)


class Blended(Divergence, name="blended"):
    """<div u>_i = d/n0 sum_j (u_j - u_i) . [(1 - theta_i) C_i + theta_i I] r_ij/r^2 W.

    Exact for linear velocity fields on any arrangement inside the fluid; on the free surface, where the
    pressure is known and a large correction would only amplify, the original model. (This project; the
    matrix of Khayyer & Gotoh 2011.)
    """

    reference: ClassVar = "khayyer2011"
    order: ClassVar = 0
    needs: ClassVar = (CORRECTION, SURFACE_SHARE)

    floor: float = Parameter(default=0.3, gt=0.0, le=1.0)
    """Least eigenvalue of the matrix that is inverted [1]."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, out: str, mirror: bool = False) -> None:
        """Write the divergence of ``velocity`` [1/s] at fluid and wall rows into ``out``."""
        # Where solid rows move like mirror images, wall rows have no equation and need no divergence.
        rows = FLUID if mirror else FLUID | WALL
        bounded_correction_matrix(self, lattice, particles, pairs, ANY, self.floor, rows)
        pair_sum(
            approach, particles, pairs, out=out, weight=self.weight, re=self.radius(lattice), rows=rows,
            arguments=(lattice.dimension / self.n0(lattice), float(mirror)),
        )  # fmt: skip
