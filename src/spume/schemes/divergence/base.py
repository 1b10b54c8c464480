"""The family of divergence models."""

from typing import ClassVar

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, PairSum
from spume.particles import FLUID, Particles
from spume.schemes.operator import Operator


@kernels.func
def mirrored(a, b, mirror):  # type: ignore[no-untyped-def]
    """Return the difference of velocity of a pair; towards a solid row, that of a mirror particle if asked for."""
    difference = b.velocity - a.velocity
    normal = b.to_surface.normalized(1e-30)
    solid = kernels.qd.cast(mirror > 0.5, kernels.i32) & kernels.qd.cast(b.kind != FLUID, kernels.i32)
    return kernels.qd.select(solid, 2.0 * difference.dot(normal) * normal, difference)


class Divergence(Operator, family="divergence"):
    """A model of the divergence of the velocity at fluid and wall rows."""

    of_normals: ClassVar[bool] = False
    """Whether a mirror image tells how the velocity changes along the normal of its wall, and nothing else."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, out: str, mirror: bool = False) -> None:
        """Write the divergence of ``velocity`` [1/s] at fluid and wall rows into ``out``.

        Args:
            out: name of the scalar field to write.
            mirror: solid neighbours move like the row's mirror image: the normal part of the difference
                counts twice, the tangential part not at all.
        """
        raise NotImplementedError

    def sums_of_velocity(
        self, lattice: Lattice, particles: Particles, pairs: Pairs, mirror: bool
    ) -> tuple[PairSum, ...]:
        """Return the sums that the model makes of the velocity, having made what they need.

        A source may make them in one pass with its own; the model then finds them kept.
        """
        return ()
