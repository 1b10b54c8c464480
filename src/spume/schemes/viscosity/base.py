"""The family of viscosity models."""

from math import inf

from spume.lattice import Lattice
from spume.named import Scheme
from spume.pairs import Pairs
from spume.particles import Particles


class Viscosity(Scheme, family="viscosity"):
    """Adds the viscous acceleration to fluid rows."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, dt: float) -> None:
        """Add nu lap(u) to ``acceleration`` [m/s^2]; neighbours take part with ``slip_velocity``."""
        raise NotImplementedError

    def max_dt(self, lattice: Lattice, viscosity: float) -> float:
        """Return the largest stable time step [s] for a kinematic viscosity [m^2/s]."""
        return inf
