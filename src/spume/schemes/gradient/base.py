"""The family of gradient models."""

from typing import ClassVar

from spume import named
from spume.lattice import Lattice
from spume.pairs import Pairs, PairView
from spume.particles import ANY, Particles
from spume.schemes.operator import Operator


class Gradient(Operator, family="gradient"):
    """A model of the gradient of a scalar field at fluid rows."""

    repels: ClassVar[bool] = False
    """Whether every pair is made to repel, so that a fluid under tension (negative pressure) makes no sense."""

    of_normals: ClassVar[bool] = False
    """Whether a wall that is asked for it may say how the pressure changes along its normal, and nothing else."""

    of_air: ClassVar[bool] = False
    """Whether the pressure beyond the surface may be that of enclosed air, ``air_pressure``."""
    completes: ClassVar[bool] = False
    """Whether neighbours missing at the free surface take part, as the matrix counts them that detects no surface."""

    def caution(self) -> str:
        """Return what is wrong with the model itself, though it can be computed, or nothing."""
        return ""

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs,
        phi: str = "pressure", out: str = "pressure_gradient", over: int = ANY, view: PairView | None = None,
        dt: float = 0.0, moved: bool = True,
    ) -> None:  # fmt: skip
        """Write the gradient of ``phi`` at fluid rows into ``out``.

        Args:
            phi: name of a scalar field.
            out: name of the vector field to write.
            over: kinds of neighbours that carry ``phi``.
            view: how a row sees the ``value`` of a neighbour, if not as the field says (walls).
            dt: time step [s], for models that also keep rows apart; 0: they do not.
            moved: whether ``velocity`` has moved the rows already (r*), or is yet to move them (r^k).
        """
        raise NotImplementedError


def completing() -> list[str]:
    """Return the names of the gradient models that count the neighbours missing at the free surface."""
    return [scheme.key for scheme in named.schemes("gradient") if getattr(scheme, "completes", False)]


def tension_bearing() -> list[str]:
    """Return the names of the gradient models that negative pressures may go with."""
    return [scheme.key for scheme in named.schemes("gradient") if not getattr(scheme, "repels", False)]
