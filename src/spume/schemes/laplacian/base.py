"""The family of Laplacian models: one coefficient per pair, for the pressure matrix and for viscosity."""

from typing import Any, ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs
from spume.particles import Particles
from spume.schemes.operator import Operator


class Laplacian(Operator, family="laplacian"):
    """A model <lap phi>_i = s sum_j c_ij (phi_j - phi_i).

    ``coefficient`` is the function c(a, b, r, w) of the kernel language; ``reads`` names the fields of a
    and b that it uses and ``scale`` gives s.
    """

    symmetric: ClassVar[bool]
    """Whether c_ij = c_ji, so that the matrix is symmetric."""
    reads: ClassVar[tuple[str, ...]] = ()
    """Fields that the coefficient reads."""
    coefficient: ClassVar[Any]
    """The coefficient c_ij of a pair."""
    compensated: ClassVar[bool] = False
    """Whether the matrix takes off sum_j c_ij r_ij . grad P, with the gradient of the step before."""

    def prepare(self, lattice: Lattice, particles: Particles, pairs: Pairs) -> None:
        """Compute what the coefficient reads; called once for a set of positions."""

    def scale(self, lattice: Lattice) -> float:
        """Return the factor s on the sum."""
        raise NotImplementedError
