"""The family of collision models."""

from spume.lattice import Lattice
from spume.named import Scheme
from spume.pairs import Pairs
from spume.particles import Particles


class Collision(Scheme, family="collision"):
    """Keeps rows from coming so close that the operators lose their meaning; a limiter that counts its uses."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, dt: float) -> None:
        """Change ``velocity`` (and ``position`` by dt times that) of approaching near pairs; count ``collisions``."""
        raise NotImplementedError
