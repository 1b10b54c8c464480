"""The family of gradient models."""

from spume.lattice import Lattice
from spume.pairs import Pairs, PairView
from spume.particles import ANY, Particles
from spume.schemes.operator import Operator


class Gradient(Operator, family="gradient"):
    """A model of the gradient of a scalar field at fluid rows."""

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs,
        phi: str = "pressure", out: str = "pressure_gradient", over: int = ANY, view: PairView | None = None,
    ) -> None:  # fmt: skip
        """Write the gradient of ``phi`` at fluid rows into ``out``.

        Args:
            phi: name of a scalar field.
            out: name of the vector field to write.
            over: kinds of neighbours that carry ``phi``.
            view: how a row sees the ``value`` of a neighbour, if not as the field says (walls).
        """
        raise NotImplementedError
