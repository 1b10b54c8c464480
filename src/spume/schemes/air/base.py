"""The family of models of the air that water traps."""

from collections.abc import Mapping
from math import inf

from spume.lattice import Lattice
from spume.named import Scheme
from spume.particles import Particles
from spume.voids import Voids


class Air(Scheme, family="air"):
    """Says which pressure the air beyond a surface has where it is enclosed; the air outside has the pressure zero."""

    def __call__(
        self, lattice: Lattice, particles: Particles, voids: Voids, periods: Mapping[int, float]
    ) -> dict[str, float]:
        """Write ``air_pressure`` [Pa] of rows near an enclosed void; return figures of the step.

        Args:
            voids: what is followed from step to step.
            periods: length [m] of each periodic axis.
        """
        raise NotImplementedError

    def max_dt(self, lattice: Lattice, particles: Particles, voids: Voids) -> float:
        """Return the largest time step [s] that the enclosed air allows."""
        return inf
