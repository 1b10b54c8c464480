"""The family of free-surface detections."""

from typing import Any, ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs
from spume.particles import Field, Particles
from spume.schemes.operator import Operator

SURFACE_SHARE = Field("surface_share", (), "1", "0 inside the fluid … 1 on the free surface")


class FreeSurface(Operator, family="free_surface"):
    """Decides how far fluid rows belong to the free surface, where the pressure is known."""

    needs: ClassVar[tuple[Field, ...]] = (SURFACE_SHARE,)

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any) -> None:
        """Write ``free_surface`` (1 or 0) and ``surface_share`` (1 … 0) of fluid and wall rows.

        Args:
            number_density: the ``NumberDensity`` scheme that wrote ``number_density``.
        """
        raise NotImplementedError
