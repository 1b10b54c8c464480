"""A free surface with images of the fluid beyond it."""

from typing import Any, ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs, PairSum, row_map, row_term
from spume.particles import FLUID, WALL, Particles
from spume.schemes.crowding import CROWDING, crowding_sum, crowding_vector, flat_surface_gradient
from spume.schemes.free_surface.base import nothing
from spume.schemes.free_surface.blended import Blended


@row_term(reads=("surface_share", "density", "number_density", "crowding"))
def images(a, scale, n0, missing, flat):  # type: ignore[no-untyped-def]
    # A sheet of one row has surfaces on both sides, whose crowding cancels; it misses twice as many neighbours.
    beyond = (1.0 - a.number_density / n0) / missing - 1.0
    return scale / a.density * a.surface_share * max(a.crowding.norm(), beyond * flat)


class Imaged(Blended, name="imaged"):
    """Beyond the surface lies the fluid's odd image, P = 0 half a spacing outside: every row is solved for.

    <lap P>_i = 2 d/n0 sum_j (P_j - P_i) W/r^2 - theta_i (4/l0) |s_i| P_i with s_i = d/n0 sum_j W r_ij/r^2 and theta of
    ``blended``. Along s_i a pressure that vanishes at l0/2 outside has the slope 2 P_i/l0, so the image's part is
    2 s_i . (2 P_i/l0) s_i/|s_i|: exact for such a linear pressure however the surface rows lie, with the Laplacian
    ``distance`` and those made from it. No surface row has a pressure from the step before, and all keep
    the volume: the surface follows the fluid instead of trembling. Inside the fluid s_i is small, so a row that is
    taken for a surface by its low n is hardly drawn. Thin sheets and single rows, where s_i cancels, are held by the
    number of the neighbours they miss. Gradient: ``imaged``. (This project.)
    """

    ids: ClassVar[tuple[str, ...]] = ()
    reference: ClassVar = "liu2018"
    known: ClassVar = False
    needs: ClassVar = (*Blended.needs, CROWDING)

    def sums(self, lattice: Lattice) -> tuple[PairSum, ...]:
        """Return the crowding."""
        return (crowding_sum(self, lattice),)

    def draw(self, lattice: Lattice, particles: Particles, laplacian: Any, number_density: Any) -> None:
        """Write ``surface_diagonal`` = (4/l0) theta |s|/rho [m/kg] and the ``surface_value`` zero."""
        weight, re, d = number_density.weight, number_density.re, lattice.dimension
        flat = -flat_surface_gradient(self.weight, self.re, d, 0.0) / lattice.spacing
        row_map(
            images, particles, out="surface_diagonal", rows=FLUID,
            arguments=(4.0 / lattice.spacing, lattice.n0(weight, re), lattice.missing(weight, re), flat),
        )  # fmt: skip
        row_map(nothing, particles, out="surface_value", rows=FLUID | WALL)

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any) -> None:
        """Write ``free_surface`` (1 or 0), ``surface_share`` (1 … 0) and ``crowding``."""
        super().__call__(lattice, particles, pairs, number_density)
        crowding_vector(self, lattice, particles, pairs)
