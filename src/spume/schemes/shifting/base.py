"""The family of particle shifting models."""

from typing import Any

from spume.lattice import Lattice
from spume.pairs import Pairs
from spume.particles import Particles
from spume.schemes.operator import Operator


class Shifting(Operator, family="shifting"):
    """Moves fluid rows slightly, from crowded to empty places, after the step."""

    def __call__(
        self,
        lattice: Lattice,
        particles: Particles,
        pairs: Pairs,
        number_density: Any,
        largest_speed: float,
        dt: float,
    ) -> None:
        """Shift ``position`` of fluid rows.

        Args:
            number_density: the ``NumberDensity`` scheme.
            largest_speed: largest speed of fluid rows [m/s].
            dt: time step [s].
        """
        raise NotImplementedError
