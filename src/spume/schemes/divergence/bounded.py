"""The corrected divergence with a bounded correction."""

from typing import ClassVar

from pydantic import Field as Parameter

from spume.lattice import Lattice
from spume.pairs import Pairs, PairSum, row_map, row_term
from spume.particles import FLUID, WALL, Particles
from spume.schemes.correction import SECOND_MOMENT, WALL_MOMENT, second_moment_sum
from spume.schemes.divergence.base import Divergence
from spume.schemes.velocity_gradient import FLOOR, VELOCITY_GRADIENT, velocity_gradient, velocity_gradient_sum


@row_term(reads=("predicted_gradient",))
def trace(a):  # type: ignore[no-untyped-def]
    return a.predicted_gradient.trace()


class Bounded(Divergence, name="bounded"):
    """<div u>_i = d/n0 sum_j (u_j - u_i) . C_i r_ij/r^2 W, C_i = M_i^-1, M_i with eigenvalues of ``floor`` at least.

    Exact for linear velocity fields on any arrangement inside the fluid. Towards a wall whose rows move like mirror
    images, r_ij counts along the wall's normal alone (``normals``; `velocity_gradient`). On a flat surface, where the
    least eigenvalue is 0.5, a floor of 0.6 adds 0.1 to all of them: a surface that is stretched along itself and sinks
    has a sixth of the divergence that the original model gives it (2D); a floor of 0.5 is exact and noisier. Where
    few neighbours are left, as in spray, the floor keeps the correction from multiplying noise. (This project;
    the matrix of Khayyer & Gotoh 2011.)
    """

    reference: ClassVar = "khayyer2011"
    order: ClassVar = 0
    needs: ClassVar = (SECOND_MOMENT, WALL_MOMENT, VELOCITY_GRADIENT)

    floor: float = Parameter(default=FLOOR, gt=0.0, le=1.0)
    """Least eigenvalue of the matrix that is inverted [1]."""

    normals: bool = True
    """Take of a mirror image how the velocity changes along its wall's normal; false: and that it does not along it."""

    @property
    def of_normals(self) -> bool:  # type: ignore[override]
        """Whether a mirror image tells how the velocity changes along the normal of its wall, and nothing else."""
        return self.normals

    def sums(self, lattice: Lattice) -> tuple[PairSum, ...]:
        """Return the second moment of the neighbours of fluid rows."""
        return (second_moment_sum(self, lattice),)

    def sums_of_velocity(
        self, lattice: Lattice, particles: Particles, pairs: Pairs, mirror: bool
    ) -> tuple[PairSum, ...]:
        """Return the gradient of the velocity."""
        return (velocity_gradient_sum(self, lattice, particles, pairs, mirror, self.floor),)

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, out: str, mirror: bool = False) -> None:
        """Write the divergence of ``velocity`` [1/s] at fluid and wall rows into ``out``."""
        velocity_gradient(self, lattice, particles, pairs, mirror, self.floor)
        row_map(trace, particles, out=out, rows=FLUID if mirror else FLUID | WALL)
