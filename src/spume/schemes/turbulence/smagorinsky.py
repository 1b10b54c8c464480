"""Eddy viscosity from the rate of strain."""

from typing import ClassVar

from pydantic import Field as Parameter

from spume.lattice import Lattice
from spume.pairs import Pairs, PairSum, pair_sums, pair_term, row_map, row_term
from spume.particles import FLUID, Field, Particles
from spume.schemes.correction import SECOND_MOMENT, floored_inverse, second_moment_sum, symmetric_matrix
from spume.schemes.turbulence.base import EFFECTIVE_VISCOSITY, Turbulence

SLIP_GRADIENT = Field(
    "slip_gradient", ("d", "d"), "1/s", "sum of W u_ij (x) r/r^2, with images of the fluid in walls",
    scratch="turbulence",
)  # fmt: skip


@pair_term(reads=("slip_velocity",), shape=("d", "d"))
def dyad(a, b, r, w):  # type: ignore[no-untyped-def]
    return (b.slip_velocity - a.slip_velocity).outer_product(r) * (w / r.dot(r))


@row_term(reads=("slip_gradient", "second_moment", "kinematic_viscosity"))
def with_eddies(a, scale, floor, square):  # type: ignore[no-untyped-def]
    correction = floored_inverse(scale * symmetric_matrix(a.second_moment), floor)
    gradient = scale * a.slip_gradient @ correction
    strain = 0.5 * (gradient + gradient.transpose())
    return a.kinematic_viscosity + square * (2.0 * strain.norm_sqr()) ** 0.5


class Smagorinsky(Turbulence, name="smagorinsky"):
    """nu_t = (C_s l0)^2 |S|, |S| = (2 S_ij S_ij)^(1/2), S the rate of strain (Smagorinsky 1963; in MPS: Pan 2012).

    The filter is the particle spacing. S comes from the corrected velocity gradient, so it is exact for linear fields
    on any arrangement inside the fluid; rows in spray, whose neighbours say little of a gradient, have a smaller one
    and with it hardly any eddies. Solid rows take part with the velocity of their image. No damping at walls: the
    mixing length C_s l0 could only be cut by the wall's kappa y, kappa = 0.41, and the first row stands at y = l0/2,
    where kappa y = 0.2 l0 is not less than C_s l0 for any usual C_s. A free surface is no wall: |S| is what its rows
    see.
    """

    ids: ClassVar = ("A6",)
    reference: ClassVar = ("smagorinsky1963", "pan2012")
    needs: ClassVar[tuple[Field, ...]] = (EFFECTIVE_VISCOSITY, SLIP_GRADIENT, SECOND_MOMENT)

    constant: float = Parameter(default=0.15, gt=0.0, le=0.25)
    """C_s [1]: 0.1 in channels, 0.12 to 0.15 in breaking waves, 0.17 in isotropic turbulence."""
    floor: float = Parameter(default=0.3, gt=0.0, le=1.0)
    """Least eigenvalue of the gradient's matrix that is inverted [1]."""

    def sums(self, lattice: Lattice) -> tuple[PairSum, ...]:
        """Return the second moment of the neighbours, and the sum that the velocity's gradient is made of."""
        return (
            second_moment_sum(self, lattice),
            PairSum((dyad,), (SLIP_GRADIENT.name,), self.weight, self.radius(lattice)),
        )

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs) -> str:
        """Write ``effective_viscosity`` of fluid rows."""
        pair_sums(self.sums(lattice), particles, pairs)
        scale, square = lattice.dimension / self.n0(lattice), (self.constant * lattice.spacing) ** 2
        row_map(with_eddies, particles, out=EFFECTIVE_VISCOSITY.name, arguments=(scale, self.floor, square))
        return EFFECTIVE_VISCOSITY.name

    def largest(self, particles: Particles) -> float:
        """Return the largest nu + nu_t [m^2/s] of the step before."""
        return particles.largest(EFFECTIVE_VISCOSITY.name, FLUID)
