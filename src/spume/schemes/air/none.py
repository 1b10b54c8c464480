"""No air."""

from collections.abc import Mapping
from typing import ClassVar

from spume.lattice import Lattice
from spume.particles import Particles
from spume.schemes.air.base import Air
from spume.voids import Voids


class Nowhere(Air, name="none"):
    """Beyond every surface is the same constant pressure: enclosed voids collapse as if they were empty."""

    reference: ClassVar = ()

    def __call__(
        self, lattice: Lattice, particles: Particles, voids: Voids, periods: Mapping[int, float]
    ) -> dict[str, float]:
        """Leave ``air_pressure`` zero."""
        return {}
