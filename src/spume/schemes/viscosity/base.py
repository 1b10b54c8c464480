"""The family of viscosity models."""

from math import inf

from spume import kernels
from spume.lattice import Lattice
from spume.named import Scheme
from spume.pairs import Pairs, PairSum
from spume.particles import FLUID, Particles
from spume.schemes.laplacian.base import Laplacian


@kernels.func
def shared_viscosity(a, b):  # type: ignore[no-untyped-def]
    """Return the harmonic mean of rho nu of a pair [Pa s]: the stress is the same on both sides of an interface.

    A solid row is the image of the row that sees it.
    """
    mu_a = a.density * a.viscosity
    mu_b = kernels.qd.select(b.kind == FLUID, b.density * b.viscosity, mu_a)
    return 2.0 * mu_a * mu_b / max(mu_a + mu_b, 1e-30)


def refuse_lagged(laplacian: Laplacian) -> None:
    """Refuse a Laplacian that takes a part of itself from the pressure of the step before."""
    if laplacian.terms().rhs is not None:
        raise ValueError(
            f"laplacian {laplacian.key!r} with correction = 'lagged' corrects the pressure only: choose "
            "correction = 'full' for the viscosity, or another laplacian"
        )


class Viscosity(Scheme, family="viscosity"):
    """Adds the viscous acceleration to fluid rows."""

    def sums(self, lattice: Lattice) -> tuple[PairSum, ...]:
        """Return what it sums at the start of a step, to be ready for its own sum; see `Operator.sums`."""
        return ()

    def as_sums(self, lattice: Lattice) -> tuple[PairSum, ...]:
        """Return the sums over pairs that are all it does, where nothing has to be made ready for them, or none.

        A step may make them in one pass with others, and then does not call the viscosity.
        """
        return ()

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, dt: float) -> None:
        """Add div(mu grad u)/rho to ``acceleration`` [m/s^2]."""
        raise NotImplementedError

    def largest(self, particles: Particles, material: float) -> float:
        """Return the largest kinematic viscosity [m^2/s], of the turbulence in the step before too.

        Args:
            material: the largest one of the materials.
        """
        return material

    def max_dt(self, lattice: Lattice, viscosity: float) -> float:
        """Return the largest stable time step [s] for a kinematic viscosity [m^2/s]."""
        return inf
