"""Optimised particle shifting: along the surface near it, in all directions inside."""

from typing import Any, ClassVar

from pydantic import Field as Parameter

from spume.lattice import Lattice
from spume.pairs import Pairs, row_map, row_term
from spume.particles import FLUID, Particles
from spume.schemes.shifting.base import Diffusive
from spume.schemes.shifting.classes import (
    INNER,
    SPLASH,
    SURFACE_FIELDS,
    classify,
    concentration_and_normal,
    limited,
    tangential,
)


@row_term(reads=("surface_class", "concentration_gradient", "surface_normal"))
def shift_of_class(a, coefficient, largest):  # type: ignore[no-untyped-def]
    gradient = a.concentration_gradient
    if a.surface_class == SPLASH:
        gradient *= 0.0
    elif a.surface_class != INNER:
        gradient = tangential(gradient, a.surface_normal)
    return limited(-coefficient * gradient, largest)


class Optimised(Diffusive, name="optimised"):
    """Optimised particle shifting, OPS (Khayyer 2017), with its four classes of rows.

    Inner: delta r_i = -D grad C; surface and vicinity: -D (I - n n) . grad C; splash: none.
    grad C_i = d/n0 sum_j W r_ij/r^2; n is the renormalised normal (see ``schemes/normal.py``), without which the normal
    part of grad C leaks through the projection on disordered surfaces; D = h^2/2. Kernel: ``weight``; volume:
    V_j grad W = d/n0 W r_ij/r^2; h = re/3. The output field ``surface_class`` shows the classes: 0 inner, 1 vicinity (a
    neighbour on the surface), 2 surface, 3 splash (no fluid neighbour off the surface).
    Conserves nothing, as it moves rows without their reaction. For violent flows whose surface should keep evenly
    spaced rows; no constant to tune, but 2.45 times the diffusion of ``fickian``: D = 0.245 l0^2 at re = 2.1 l0.
    """

    ids: ClassVar = ("D3",)
    reference: ClassVar = "khayyer2017"
    needs: ClassVar = (*Diffusive.needs, *SURFACE_FIELDS)

    strength: float = Parameter(default=0.5, ge=0.0, le=1.0)
    """Coefficient of D = strength h^2; the paper's is 0.5 [1]."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any, dt: float) -> None:
        """Shift ``position`` of fluid rows; ``shift`` keeps the displacement, ``surface_class`` the classes."""
        classify(self, lattice, particles, pairs)
        concentration_and_normal(self, lattice, particles, pairs)
        row_map(
            shift_of_class, particles, out="shift", rows=FLUID,
            arguments=(self.strength * self.smoothing_length(lattice) ** 2, self.largest * lattice.spacing),
        )  # fmt: skip
        self.shift(lattice, particles, pairs)
