"""The family of turbulence models: what motion smaller than a particle adds to the viscosity."""

from typing import ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs
from spume.particles import Field, Particles
from spume.schemes.operator import Operator

EFFECTIVE_VISCOSITY = Field(
    "effective_viscosity", (), "m^2/s", "kinematic viscosity with that of the turbulence; limits the next time step",
    restart=True,
)  # fmt: skip


class Turbulence(Operator, family="turbulence"):
    """A model of the eddy viscosity nu_t of sub-particle-scale motion."""

    needs: ClassVar[tuple[Field, ...]] = ()
    given: ClassVar[str] = ""
    """Field that holds nu + nu_t without anything being computed, or nothing."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs) -> str:
        """Return the name of the field that holds nu + nu_t [m^2/s]; neighbours show ``slip_velocity``."""
        raise NotImplementedError

    def largest(self, particles: Particles) -> float:
        """Return the largest nu + nu_t [m^2/s] of the step before; 0 for a model that adds nothing."""
        return 0.0
