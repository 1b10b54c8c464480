"""A free surface without detection: missing neighbours are particles of pressure zero."""

from typing import Any, ClassVar

from pydantic import Field as Parameter

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, row_map, row_term
from spume.particles import FLUID, WALL, Particles
from spume.schemes.free_surface.base import JUDGES_N, FreeSurface, nothing


@row_term(reads=("number_density",))
def missing(a, n0, full):  # type: ignore[no-untyped-def]
    return min(max(1.0 - a.number_density / n0, 0.0) / full, 1.0)


@row_term(reads=("surface_share",))
def mostly(a):  # type: ignore[no-untyped-def]
    return kernels.qd.cast(a.surface_share > 0.5, kernels.i32)


@row_term(reads=("number_density", "density"))
def conceptual(a, n0, scale):  # type: ignore[no-untyped-def]
    return scale / a.density * max(1.0 - a.number_density / n0, 0.0)


class DetectionFree(FreeSurface, name="detection-free"):
    """Missing neighbours are conceptual particles with P = 0 (Chen, Xi & Sun 2014; the review prints Sun 2014).

    <lap P>_i = 2 d/(lambda n0) [sum_j (P_j - P_i) W - (n0 - n_i)^+ P_i]: the diagonal of the matrix becomes
    max(n_i, n0), every row is solved for and none has to be detected; the step's surface pressure is not used.
    ``free_surface`` and ``surface_share`` only tell what else depends on the surface (shifting, gradient,
    outputs) how much is missing. No row jumps between known and unknown; but the surface lies a whole spacing
    outside the outermost centres, and disorder inside, where n < n0 by chance, is drawn to P = 0 as well.

    The gradient must count the missing neighbours too: ``dummy-neighbour`` does it nearly as the matrix (1.07 of the
    gradient of a pressure that vanishes a spacing outside a flat surface), ``completed`` takes them to be half a
    spacing outside (1.5), so that the surface settles three quarters of one outside. One that does not, ``minimum``
    say, lifts the rows of a flat surface with half of the pressure's slope. They fall, and the matrix answers by
    raising their pressure, which is unknown here, and with it that of all the water below.
    """

    ids: ClassVar = ("E7",)
    reference: ClassVar = "chen2014"
    known: ClassVar = False
    unused: ClassVar = JUDGES_N

    full: float = Parameter(default=0.3, gt=0.0, lt=1.0)
    """Missing part of n0 that counts as a whole share in the surface; 0.3 is that of a flat surface [1]."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any) -> None:
        """Write ``surface_share`` = (1 - n/n0)^+/full, at most 1, and ``free_surface`` (1 where it exceeds 1/2)."""
        n0 = number_density.n0(lattice)
        row_map(missing, particles, out="surface_share", rows=FLUID | WALL, arguments=(n0, self.full))
        row_map(mostly, particles, out="free_surface", rows=FLUID | WALL)

    def draw(self, lattice: Lattice, particles: Particles, laplacian: Any, number_density: Any) -> None:
        """Write ``surface_diagonal`` = 2 d/(lambda rho) (1 - n/n0)^+ [m/kg] and the ``surface_value`` zero."""
        scale = 2.0 * lattice.dimension / laplacian.lambda_(lattice)
        row_map(
            conceptual, particles, out="surface_diagonal", rows=FLUID | WALL,
            arguments=(number_density.n0(lattice), scale),
        )  # fmt: skip
        row_map(nothing, particles, out="surface_value", rows=FLUID | WALL)
