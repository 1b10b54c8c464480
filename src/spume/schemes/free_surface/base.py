"""The family of free-surface detections."""

from typing import Any, ClassVar, Self

from pydantic import model_validator

from spume.lattice import Lattice
from spume.pairs import Pairs, row_map, row_term
from spume.particles import FLUID, WALL, Field, Particles
from spume.schemes.operator import Operator

JUDGES_N = dict.fromkeys(("weight", "re"), "n is that of number_density, with the weight and the re given there")
"""What a detection that looks at n alone does not compute with; see `Scheme.unused`."""

SURFACE_SHARE = Field("surface_share", (), "1", "0 inside the fluid … 1 on the free surface")


@row_term()
def nothing(a):  # type: ignore[no-untyped-def]
    return 0.0


@row_term(reads=("free_surface",))
def as_share(a):  # type: ignore[no-untyped-def]
    return 1.0 * a.free_surface


class FreeSurface(Operator, family="free_surface"):
    """Decides how far fluid rows belong to the free surface, where the pressure is known."""

    needs: ClassVar[tuple[Field, ...]] = (SURFACE_SHARE,)
    known: ClassVar[bool] = True
    """Whether the rows it marks have a known pressure; otherwise the matrix solves for them too."""
    of_air: ClassVar[bool] = False
    """Whether the pressure beyond the surface may be that of enclosed air, ``air_pressure``."""
    least_tie: ClassVar[int] = 1
    """Hundredths of the diagonal of one row that all of a connected fluid must be drawn by to have a surface at all."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        """Refuse limits between which no row can be."""
        lower, upper = (getattr(self, n, None) for n in ("lower", "upper"))
        if lower is not None and upper is not None and not lower < upper:
            raise ValueError(f"free_surface {self.key!r}: lower = {lower:g} must be less than upper = {upper:g}")
        return self

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any) -> None:
        """Write ``free_surface`` (1 or 0) and ``surface_share`` (1 … 0) of fluid and wall rows.

        Args:
            number_density: the ``NumberDensity`` scheme that wrote ``number_density``.
        """
        raise NotImplementedError

    def draw(self, lattice: Lattice, particles: Particles, laplacian: Any, number_density: Any) -> None:
        """Write ``surface_diagonal`` [m/kg], how strongly the matrix draws a row towards ``surface_value``.

        A scheme may change ``surface_value`` [Pa] too, which holds the step's pressure of surface rows.

        Args:
            laplacian: the ``Laplacian`` of the matrix, whose coefficients the addition goes with.
            number_density: the ``NumberDensity`` scheme that wrote ``number_density``.
        """
        row_map(nothing, particles, out="surface_diagonal", rows=FLUID | WALL)
