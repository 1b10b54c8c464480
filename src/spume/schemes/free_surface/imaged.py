"""A free surface with images of the fluid beyond it."""

from typing import Any, ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs, PairSum, RowMap, row_maps, row_term
from spume.particles import FLUID, WALL, Particles
from spume.schemes.crowding import crowding_sum, flat_surface_gradient
from spume.schemes.free_surface.base import nothing
from spume.schemes.free_surface.blended import Blended
from spume.schemes.surface_images import IMAGE_FIELDS, IMAGES_DENSITY, density_of_images, surface_images

LEAST_FLUID = 0.2
"""Part of n that fluid brings at least to a row inside the fluid, in a corner of two or three walls too [1]."""


@row_term(reads=("surface_share", "density", "number_density", "images", "surface_distance"))
def images(a, scale, n0, missing, flat, l0):  # type: ignore[no-untyped-def]
    # A sheet of one row has surfaces on both sides, whose crowding cancels; it misses twice as many neighbours.
    beyond = (1.0 - a.number_density / n0) / missing - 1.0
    return scale / a.density * a.surface_share * max(a.images.norm() / a.surface_distance, 2.0 * beyond * flat / l0)


@row_term(reads=("air_pressure",))
def of_air(a):  # type: ignore[no-untyped-def]
    return a.air_pressure


@row_term(reads=("surface_diagonal", "number_density", "solid_density", "density"))
def held_alone(a, scale):  # type: ignore[no-untyped-def]
    # What has walls around it and hardly any fluid is no inside of anything, however crowded it is.
    share = 1.0 - a.solid_density / max(a.number_density, 1e-30)
    alone = min(max(1.0 - share / LEAST_FLUID, 0.0), 1.0)
    return a.surface_diagonal + scale / a.density * alone / (1.02 - alone)


class Imaged(Blended, name="imaged"):
    """Beyond the surface lies the fluid's odd image, P = 0 at the distance delta outside: every row is solved for.

    <lap P>_i = 2 d/n0 sum_j (P_j - P_i) W/r^2 - 2 theta_i |b_i| P_i/delta_i with theta of ``blended``, b_i the vector
    of the images and delta_i the distance of the row from the surface, l0/2 where the arrangement is the lattice
    (`surface_images`). Along b_i a pressure that vanishes at delta_i outside has the slope P_i/delta_i, so the image's
    part is 2 b_i . (P_i/delta_i) b_i/|b_i|: exact for such a linear pressure however the surface rows lie, with the
    Laplacian ``distance``, alone or with the lagged correction. No surface row has a pressure from the step before,
    and all keep the volume: the surface follows the fluid instead of trembling. Inside the fluid b_i is small, so a
    row that is taken for a surface by its low n is hardly drawn. Thin sheets and single rows, where b_i cancels,
    are held by the number of the neighbours they miss. Rows with walls around them and less than a fifth of their n
    from fluid are drawn to the surface's pressure, the more the less fluid is there. Gradient: ``imaged``; the
    source ``divergence-density`` counts the images in n. (This project.)
    """

    ids: ClassVar[tuple[str, ...]] = ()
    reference: ClassVar = ()
    unused: ClassVar = {}
    known: ClassVar = False
    of_air: ClassVar = True
    needs: ClassVar = (*Blended.needs, *IMAGE_FIELDS, IMAGES_DENSITY)

    def sums(self, lattice: Lattice) -> tuple[PairSum, ...]:
        """Return the crowding."""
        return (crowding_sum(self, lattice),)

    def draw(self, lattice: Lattice, particles: Particles, laplacian: Any, number_density: Any) -> None:
        """Write ``surface_diagonal`` = 2 theta |b|/(delta rho) [m/kg] and the ``surface_value``, the air's pressure."""
        weight, re, d = number_density.weight, number_density.re, lattice.dimension
        flat = -flat_surface_gradient(self.weight, self.re, d, 0.0) / lattice.spacing
        measures = (2.0, lattice.n0(weight, re), lattice.missing(weight, re), flat, lattice.spacing)
        maps = (
            RowMap(nothing, "surface_diagonal", FLUID | WALL),
            RowMap(of_air, "surface_value", FLUID | WALL),
            RowMap(images, "surface_diagonal", arguments=measures, where="surface_share"),
            RowMap(held_alone, "surface_diagonal", arguments=(2.0 * d / laplacian.lambda_(lattice),)),
        )
        row_maps(maps, particles)

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any) -> None:
        """Write ``free_surface`` (1 or 0), ``surface_share`` (1 … 0), and what the images need."""
        super().__call__(lattice, particles, pairs, number_density)
        surface_images(self, lattice, particles, pairs)
        density_of_images(number_density, lattice, particles, pairs)
