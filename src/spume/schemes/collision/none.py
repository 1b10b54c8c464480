"""No collision treatment."""

from typing import ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs
from spume.particles import Particles
from spume.schemes.collision.base import Collision


class Free(Collision, name="none"):
    """Rows may come as close as they like."""

    conserves: ClassVar = frozenset({"momentum", "angular momentum"})

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, dt: float) -> None:
        """Leave ``velocity`` as it is."""
