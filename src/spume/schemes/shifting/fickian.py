"""Particle shifting by Fick's law."""

from typing import Any, ClassVar

from pydantic import Field as Parameter

from spume.lattice import Lattice
from spume.pairs import Pairs, pair_sum, pair_term
from spume.particles import ANY, Particles
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.shifting.base import Diffusive, advective_diffusivity


def _shift(a, crowding, scale, largest):  # type: ignore[no-untyped-def]
    # On the surface the crowding is one-sided and would push rows out.
    shift = (a.surface_share - 1.0) * scale * crowding
    length = shift.norm()
    if length > largest:
        shift *= largest / length
    return shift


@pair_term(reads=("surface_share",), shape=("d",), finish=_shift)
def crowding(a, b, r, w, scale, largest):  # type: ignore[no-untyped-def]
    return w / r.dot(r) * r


class Fickian(Diffusive, name="fickian"):
    """delta r_i = -D (1 - theta_i) d/n0 sum_j W r_ij/r^2: from crowded to empty places (Xu 2009).

    Xu shifts by C |u|max dt sum_j (mean r/r)^2 n_ij; here the MPS weight takes the place of the inverse square and
    the sum is the gradient of the concentration, grad C. Kernel: ``weight``; volume: V_j grad W = d/n0 W r_ij/r^2;
    h = re/3. D = A l0^2, or with ``advective`` D = A h |u|max dt. Xu's flows have no free surface: towards one the
    shift fades out with the row's share theta, so the outermost rows keep their places; ``fickian-surface``
    and ``optimised`` move them along the surface. Conserves nothing, as it moves rows without their reaction.
    Small, smooth, one pass over the list; the default, ``fickian-along-surface``, is made of it.
    """

    ids: ClassVar[tuple[str, ...]] = ("D1",)
    reference: ClassVar[str | tuple[str, ...]] = "xu2009"
    needs: ClassVar = (*Diffusive.needs, SURFACE_SHARE)

    strength: float = Parameter(default=0.1, ge=0.0, le=1.0)
    """Coefficient A of the constant D = A l0^2 [1]."""
    advective: float | None = Parameter(default=None, ge=0.0)
    """Coefficient of D = A h |u|max dt, in place of the constant D [1]."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any, dt: float) -> None:
        """Shift ``position`` of fluid rows; ``shift`` keeps the displacement."""
        constant = self.strength * lattice.spacing**2
        coefficient = advective_diffusivity(self, self.advective, constant, lattice, particles, dt)
        pair_sum(
            crowding, particles, pairs, out="shift", weight=self.weight, re=self.radius(lattice), over=ANY,
            arguments=(coefficient * lattice.dimension / self.n0(lattice), self.largest * lattice.spacing),
        )  # fmt: skip
        self.shift(lattice, particles, pairs)
