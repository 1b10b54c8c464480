"""Particle shifting by Fick's law that goes on along the free surface."""

from typing import Any, ClassVar, Self

from pydantic import Field as Parameter
from pydantic import model_validator

from spume import kernels
from spume.kernels import sqrt
from spume.lattice import Lattice
from spume.pairs import Pairs, row_map, row_term
from spume.particles import FLUID, Field, Particles
from spume.schemes.crowding import CROWDING, crowding_vector
from spume.schemes.normal import NORMAL_FIELDS, surface_normals
from spume.schemes.relative_motion import RELATIVE_MOTION, relative_motion
from spume.schemes.shifting.base import advective_diffusivity
from spume.schemes.shifting.classes import limited, tangential
from spume.schemes.shifting.fickian import Fickian
from spume.schemes.surface_images import IMAGES_CROWDING, IMAGES_DENSITY, crowding_of_images, no_spray


@kernels.func
def displacement(a, inside, constant, relative, spray, supported, largest):  # type: ignore[no-untyped-def]
    move = (1.0 - a.surface_share) * inside
    if a.surface_share > 0.0:
        share = a.surface_share * no_spray(a, spray, supported)
        move += share * tangential(a.crowding, a.surface_normal)
    return limited(-min(constant, relative * sqrt(a.relative_motion)) * move, largest)


_READS = ("crowding", "surface_share", "surface_normal", "number_density", "relative_motion")


@row_term(reads=_READS)
def shift(a, constant, relative, spray, supported, largest):  # type: ignore[no-untyped-def]
    return displacement(a, a.crowding, constant, relative, spray, supported, largest)


@row_term(reads=(*_READS, "images_crowding", "images_near"))
def shift_with_images(a, constant, relative, spray, supported, largest):  # type: ignore[no-untyped-def]
    inside = a.crowding
    if a.images_near > 0.0:
        # Images stand for what a row misses. What they would crowd, as in the sheets of a splash, is their own error.
        completed = -inside.dot(a.images_crowding) / max(a.images_crowding.norm_sqr(), 1e-30)
        inside += min(max(completed, 0.0), 1.0) * a.images_crowding
    return displacement(a, inside, constant, relative, spray, supported, largest)


class FickianAlongSurface(Fickian, name="fickian-along-surface"):
    """delta r_i = -D_i [(1 - theta_i) (s_i + c_i s'_i) + theta_i beta_i (I - n_i n_i) s_i], s = d/n0 sum_j W r_ij/r^2.

    ``fickian`` inside, along the surface on it: rows of a surface that keep their places crowd there in pairs,
    which pushes one of each out of the water. n is the renormalised normal; beta falls from 1 to 0
    between 0.65 and 0.5 n0, for spray has no surface to go along. No row is sorted into classes, so none
    jumps. D_i is that of ``fickian``, but at most A l0 max_j |u_j - u_i| dt: rows that do not move against each other
    do not become disordered, and water that is almost at rest, shifted at each step all the same, sinks into
    itself by a part of a thousand and feeds its waves. s' is the same sum over the images that a free surface with
    such (``imaged``) has beyond it, c in 0 ... 1 what makes the length of the whole least: images make up for
    neighbours that are missing and crowd none. Without them the row below the surface misses the neighbour two
    spacings above it, presses upwards, and one particle after the other gets into the outermost row. Conserves
    nothing, as it moves rows without their reaction.
    (This project; Xu 2009 with the tangential part of Lind 2012.)
    """

    ids: ClassVar[tuple[str, ...]] = ()
    reference: ClassVar = ("xu2009", "lind2012")
    needs: ClassVar = (*Fickian.needs, CROWDING, IMAGES_CROWDING, *RELATIVE_MOTION, *NORMAL_FIELDS)

    images: bool = True
    """Count the images beyond the surface, where the free surface has them."""
    relative: float = Parameter(default=6.5, ge=0.0)
    """Coefficient of the limit A l0 max_j |u_j - u_i| dt of D_i, by how far neighbours move against each other [1]."""
    spray: float = Parameter(default=0.5, ge=0.0, lt=1.0)
    """Fraction of n0 up to which a surface row is spray, which is not shifted [1]."""
    supported: float = Parameter(default=0.65, gt=0.0, le=1.0)
    """Fraction of n0 from which a surface row is shifted along the surface in full [1]."""

    def needed(self) -> tuple[Field, ...]:
        """Return the needed fields, without what only ``images`` uses."""
        return tuple(f for f in super().needed() if self.images or f != IMAGES_CROWDING)

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.spray > self.supported:
            raise ValueError(
                f"shifting {self.key!r}: spray = {self.spray:g} must not exceed supported = {self.supported:g}"
            )
        return self

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any, dt: float) -> None:
        """Shift ``position`` of fluid rows; ``shift`` keeps the displacement."""
        constant = self.strength * lattice.spacing**2
        coefficient = advective_diffusivity(self, self.advective, constant, lattice, particles, dt)
        relative_motion(self, lattice, particles, pairs, number_density)
        crowding_vector(self, lattice, particles, pairs)
        surface_normals(self, lattice, particles, pairs, where="surface_share")
        n0 = number_density.n0(lattice)
        spray, supported = self.spray * n0, self.supported * n0
        # The gradient ``imaged`` has images beside any detection; only the free surface of this name is made of them.
        counted = self.images and IMAGES_DENSITY.name in particles.fields
        if counted:
            crowding_of_images(self, lattice, particles, pairs, spray, supported)
        row_map(
            shift_with_images if counted else shift, particles, out="shift", rows=FLUID,
            arguments=(
                coefficient, self.relative * lattice.spacing * dt, spray, supported, self.largest * lattice.spacing
            ),
        )  # fmt: skip
        self.shift(lattice, particles, pairs)
