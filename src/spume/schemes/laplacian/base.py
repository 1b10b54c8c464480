"""The family of Laplacian models: pair and row formulas that the pressure matrix, viscosity and diffusion share."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs
from spume.particles import ANY, Particles
from spume.schemes.operator import Operator


@dataclass(frozen=True)
class Terms:
    """What a Laplacian states, as functions of the kernel language (made with ``kernels.func``).

    Attributes:
        coefficient: c(a, b, r, w) of a pair.
        reads: fields of a and b that the coefficient reads.
        diagonal: d(a) of a row: missing neighbours beyond the free surface, which carry the value of the
            surroundings. Only a system that knows such a value takes it (the pressure does, a velocity does not).
        rhs: f(a, lean) of a row, with lean = 1/rho_i sum_j c_ij r_ij and c_ij without the 1/rho_ij of the pair: what
            the right side of the pressure's system receives.
        row_reads: fields of a that ``diagonal`` and ``rhs`` read.
    """

    coefficient: Callable[..., Any]
    reads: tuple[str, ...] = ()
    diagonal: Callable[..., Any] | None = None
    rhs: Callable[..., Any] | None = None
    row_reads: tuple[str, ...] = ()


class Laplacian(Operator, family="laplacian"):
    """A model <lap phi>_i = s [sum_j c_ij (phi_j - phi_i) + d_i (phi_outside - phi_i)]."""

    symmetric: ClassVar[bool]
    """Whether c_ij = c_ji, so that the matrix is symmetric and a diffused quantity is conserved."""
    completes: ClassVar[bool] = False
    """Whether its coefficients make up themselves for the neighbours that a row of the free surface misses."""

    def terms(self) -> Terms:
        """Return the formulas; the same objects each time, so that they compile once."""
        raise NotImplementedError

    def prepare(self, lattice: Lattice, particles: Particles, pairs: Pairs, over: int = ANY) -> None:
        """Compute what the formulas read; called once for a set of positions.

        Args:
            over: kinds of the neighbours that take part in the sum.
        """

    def caution(self, of_slope: bool, number_density: Operator, of_crowding: bool = False) -> str:
        """Return what does not fit about a source of the pressure equation and this model, or nothing.

        Args:
            of_slope: whether the source sums the derivative of the weight (see ``Source``).
            number_density: the ``NumberDensity`` scheme, whose weight and radius it is summed with.
            of_crowding: whether it measures how rows have moved together (``Source.from_velocity`` is false).
        """
        if of_slope:
            size = "1.42 in 2D, 1.07 in 3D with the weight inverse and re = 2.1"
            return f"carries a factor, -sum_j r dW/dr/(d n0) ({size}), that only the laplacian higher-order shares"
        return ""

    def scale(self, lattice: Lattice) -> float:
        """Return the factor s on the sum."""
        raise NotImplementedError
