"""No shifting."""

from typing import Any, ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs
from spume.particles import Particles
from spume.schemes.shifting.base import Shifting


class Unshifted(Shifting, name="none"):
    """Rows stay where the flow took them."""

    conserves: ClassVar = frozenset({"momentum", "angular momentum"})
    unused: ClassVar = dict.fromkeys(("weight", "re"), "no row is moved")

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any, dt: float) -> None:
        """Leave ``position`` as it is."""
