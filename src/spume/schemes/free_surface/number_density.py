"""Free surface where the number density is low."""

from typing import Any, ClassVar

from pydantic import Field as Parameter

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, row_map, row_term
from spume.particles import FLUID, WALL, Particles
from spume.schemes.free_surface.base import JUDGES_N, FreeSurface, as_share


@row_term(reads=("number_density",))
def below(a, limit):  # type: ignore[no-untyped-def]
    return kernels.qd.cast(a.number_density < limit, kernels.i32)


class LowNumberDensity(FreeSurface, name="number-density"):
    """A row is on the free surface if n < beta n0 (Koshizuka & Oka 1996; review Eq. 7).

    Simple and cheap; inside a disordered fluid it also finds surfaces where there are none.
    """

    ids: ClassVar = ("A4", "E1")
    reference: ClassVar = "koshizuka1996"
    unused: ClassVar = JUDGES_N

    beta: float = Parameter(default=0.95, gt=0.5, le=1.0)
    """Fraction of n0 below which a row is on the surface [1]."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any) -> None:
        """Write ``free_surface`` (1 or 0) of fluid and wall rows."""
        row_map(
            below, particles, out="free_surface", rows=FLUID | WALL,
            arguments=(self.beta * number_density.n0(lattice),),
        )  # fmt: skip
        row_map(as_share, particles, out="surface_share", rows=FLUID | WALL)
