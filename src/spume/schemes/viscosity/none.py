"""No viscosity."""

from typing import ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs
from spume.particles import Particles
from spume.schemes.viscosity.base import Viscosity


class Inviscid(Viscosity, name="none"):
    """An ideal fluid: nothing is added."""

    conserves: ClassVar = frozenset({"momentum", "energy"})

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, dt: float) -> None:
        """Leave ``acceleration`` as it is."""
