"""No turbulence model."""

from typing import ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs
from spume.particles import Particles
from spume.schemes.turbulence.base import Turbulence


class Laminar(Turbulence, name="none"):
    """What the particles resolve is all the motion there is: nothing is added."""

    order: ClassVar = None
    given: ClassVar = "kinematic_viscosity"
    unused: ClassVar = dict.fromkeys(("weight", "re"), "nothing is summed")

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs) -> str:
        """Return ``kinematic_viscosity``."""
        return self.given
