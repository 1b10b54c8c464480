"""Particle shifting by Fick's law with a treatment of the free surface."""

from typing import Any, ClassVar

from pydantic import Field as Parameter

from spume.lattice import Lattice
from spume.pairs import Pairs, row_map, row_term
from spume.particles import FLUID, Particles
from spume.schemes.crowding import flat_surface_gradient
from spume.schemes.shifting.base import Diffusive, advective_diffusivity
from spume.schemes.shifting.classes import (
    INNER,
    SURFACE,
    SURFACE_FIELDS,
    classify,
    concentration_and_normal,
    limited,
    tangential,
)


@row_term(reads=("surface_class", "concentration_gradient", "surface_normal"))
def shift_at_surface(a, coefficient, normal_share, reference, largest):  # type: ignore[no-untyped-def]
    gradient = a.concentration_gradient
    if a.surface_class != INNER:
        normal = a.surface_normal
        across = 0.0 * normal
        if a.surface_class >= SURFACE:
            across = normal_share * (gradient.dot(normal) - reference) * normal
        gradient = tangential(gradient, normal) + across
    return limited(-coefficient * gradient, largest)


class FickianSurface(Diffusive, name="fickian-surface"):
    """delta r_i = -D [(I - n n) . grad C + alpha_n (n . grad C - beta) n] near the surface, else -D grad C (Lind 2012).

    grad C_i = d/n0 sum_j [1 + R (W/W(l0))^4] W r_ij/r^2 with R = 0.2, against clumps. Kernel: ``weight``;
    volume: V_j grad W = d/n0 W r_ij/r^2; h = re/3. n is the renormalised normal; beta is n . grad C of a flat
    surface on the lattice, so the normal part is a relaxation towards the lattice's own distance.
    Near the surface: on it or with a neighbour on it; in the vicinity there is no normal part.
    Conserves nothing, as it moves rows without their reaction. For long runs with a smooth surface.
    """

    ids: ClassVar = ("D2",)
    reference: ClassVar = "lind2012"
    needs: ClassVar = (*Diffusive.needs, *SURFACE_FIELDS)

    strength: float = Parameter(default=0.1, ge=0.0, le=1.0)
    """Coefficient A of the constant D = A l0^2 [1]."""
    advective: float | None = Parameter(default=None, ge=0.0)
    """Coefficient of D = A h |u|max dt, in place of the constant D [1]."""
    tensile: float = Parameter(default=0.2, ge=0.0, le=1.0)
    """Coefficient R of the term against clumps [1]."""
    normal_share: float = Parameter(default=0.0, ge=0.0, le=1.0)
    """Coefficient alpha_n of the normal part on the surface: 0 for long calm runs, 0.1 for violent ones [1]."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any, dt: float) -> None:
        """Shift ``position`` of fluid rows; ``shift`` keeps the displacement, ``surface_class`` the classes."""
        classify(self, lattice, particles, pairs)
        concentration_and_normal(self, lattice, particles, pairs, self.tensile)
        constant = self.strength * lattice.spacing**2
        coefficient = advective_diffusivity(self, self.advective, constant, lattice, particles, dt)
        reference = flat_surface_gradient(self.weight, self.re, lattice.dimension, self.tensile) / lattice.spacing
        row_map(
            shift_at_surface, particles, out="shift", rows=FLUID,
            arguments=(coefficient, self.normal_share, reference, self.largest * lattice.spacing),
        )  # fmt: skip
        self.shift(lattice, particles, pairs)
