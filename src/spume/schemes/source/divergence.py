"""The source that makes the velocity free of divergence."""

from typing import Any, ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs, row_map, row_term
from spume.particles import FLUID, WALL, Particles
from spume.schemes.source.base import Source


@row_term(reads=("divergence",))
def rate(a, dt):  # type: ignore[no-untyped-def]
    return a.divergence / dt


class VelocityDivergence(Source, name="divergence"):
    """div(grad(P)/rho) = div(u*)/dt.

    Smooth pressure; errors of the volume are not corrected and accumulate.
    """

    ids: ClassVar = ("S5",)
    reference: ClassVar = "cummins1999"
    instant: ClassVar = "k"
    from_velocity: ClassVar = True

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs, dt: float,
        divergence: Any, number_density: Any, mirror: bool,
    ) -> None:  # fmt: skip
        """Write ``source`` of fluid and wall rows."""
        divergence(lattice, particles, pairs, out="divergence", mirror=mirror)
        row_map(rate, particles, out="source", rows=FLUID | WALL, arguments=(dt,))
