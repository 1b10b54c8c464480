"""A free surface that rows join gradually."""

from typing import Any, ClassVar

from pydantic import Field as Parameter

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, RowMap, row_map, row_maps, row_term
from spume.particles import FLUID, WALL, Particles
from spume.schemes.free_surface.base import JUDGES_N, FreeSurface


@row_term(reads=("number_density",))
def share(a, upper, lower):  # type: ignore[no-untyped-def]
    return min(max((upper - a.number_density) / (upper - lower), 0.0), 1.0)


@row_term(reads=("surface_share", "density"))
def growing(a, scale):  # type: ignore[no-untyped-def]
    return scale / a.density * a.surface_share / (1.02 - a.surface_share)


@row_term(reads=("surface_share",))
def mostly(a):  # type: ignore[no-untyped-def]
    return kernels.qd.cast(a.surface_share > 0.5, kernels.i32)


class Blended(FreeSurface, name="blended"):
    """A row belongs to the surface by the share theta = (upper - n/n0)/(upper - lower), limited to 0 … 1.

    The pressure matrix draws a row towards the surface pressure with a weight that grows with theta, from nothing
    to about the row's own diagonal at theta = 1/2; with more than that the row has the surface pressure itself. A
    row that comes and goes from one step to the next changes its pressure by half of what a sharp detection
    changes, which is where much of such noise comes from. A connected body of fluid whose rows are all together drawn
    by less than a fifth of a row's diagonal has no surface: in a tank that is full some row has a low n by chance.
    (This project.)
    """

    ids: ClassVar[tuple[str, ...]] = ("E1",)
    reference: ClassVar[str | tuple[str, ...]] = "koshizuka1996"
    unused: ClassVar = JUDGES_N
    least_tie: ClassVar[int] = 20  # half of what draws a row of a flat surface: less is a low n by chance

    upper: float = Parameter(default=0.9, gt=0.5, le=1.0)
    """Fraction of n0 at which a row begins to belong to the surface [1]."""
    lower: float = Parameter(default=0.75, gt=0.3, le=1.0)
    """Fraction of n0 at which it belongs to it entirely [1]."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any) -> None:
        """Write ``free_surface`` (1 or 0) and ``surface_share`` (1 … 0) of fluid and wall rows."""
        n0 = number_density.n0(lattice)
        limits = (self.upper * n0, self.lower * n0)
        maps = (
            RowMap(share, "surface_share", FLUID | WALL, limits),
            RowMap(mostly, "free_surface", FLUID | WALL),
        )
        row_maps(maps, particles)

    def draw(self, lattice: Lattice, particles: Particles, laplacian: Any, number_density: Any) -> None:
        """Write ``surface_diagonal`` = 2 d/(lambda rho) theta/(1.02 - theta) [m/kg]."""
        row_map(
            growing, particles, out="surface_diagonal", rows=FLUID | WALL,
            arguments=(2.0 * lattice.dimension / laplacian.lambda_(lattice),),
        )  # fmt: skip
