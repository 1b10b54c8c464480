"""The source of the original method: the deviation of the number density."""

from typing import Any, ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs, row_map, row_term
from spume.particles import FLUID, WALL, Particles
from spume.schemes.source.base import Source


@row_term(reads=("number_density",))
def deviation(a, n0, dt):  # type: ignore[no-untyped-def]
    return -(a.number_density - n0) / (n0 * dt * dt)


class Density(Source, name="density"):
    """div(grad(P)/rho) = -(n* - n0)/(n0 dt^2) (Koshizuka & Oka 1996; review Eq. 6).

    Keeps the volume, but turns every disorder of the particles into pressure: noisy.
    """

    ids: ClassVar = ("A4", "S1")
    reference: ClassVar = "koshizuka1996"
    instant: ClassVar = "*"
    from_velocity: ClassVar = False
    of_volume: ClassVar = True

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs, dt: float,
        divergence: Any, number_density: Any, mirror: bool,
    ) -> None:  # fmt: skip
        """Write ``source`` of fluid and wall rows."""
        row_map(deviation, particles, out="source", rows=FLUID | WALL, arguments=(number_density.n0(lattice), dt))
