"""The corrected gradient with images of the fluid beyond the free surface."""

from typing import ClassVar

from pydantic import Field as Parameter

from spume.lattice import Lattice
from spume.pairs import Pairs, PairView, pair_sum, pair_sums, pair_term
from spume.particles import ANY, Particles
from spume.schemes.correction import SECOND_MOMENT, floored_inverse, second_moment_sum, symmetric_matrix
from spume.schemes.crowding import CROWDING, crowding_sum
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.gradient.base import Gradient


def _corrected(a, total, scale, floor, l0):  # type: ignore[no-untyped-def]
    images = (a.surface_share * l0 / max(a.crowding.norm(), 1e-9 / l0)) * a.crowding.outer_product(a.crowding)
    return scale * floored_inverse(scale * symmetric_matrix(a.second_moment) + images, floor) @ total


@pair_term(reads=("value", "second_moment", "surface_share", "crowding"), shape=("d",), finish=_corrected)
def difference(a, b, r, w, scale, floor, l0):  # type: ignore[no-untyped-def]
    return (b.value - a.value + 2.0 * a.surface_share * a.value) * (w / r.dot(r)) * r


class Imaged(Gradient, name="imaged"):
    """<grad P>_i = C_i [d/n0 sum_j (P_j - P_i) W r_ij/r^2 + 2 theta_i P_i s_i], s_i = d/n0 sum_j W r_ij/r^2.

    C_i = [M_i + theta_i l0 s_i (x) s_i/|s_i|]^-1 with theta_i the row's share in the free surface, eigenvalues of
    the bracket ``floor`` at least. The images beyond the surface, at -s_i all together, have the pressure that
    vanishes at l0/2 outside and goes on with the slope 2 P_i/l0. Exact for linear fields on any arrangement inside
    the fluid, and for those that vanish there on any arrangement of its surface, so that
    rows of a surface that is stretched or crowded are still held. The same images as those of the
    ``free_surface`` of that name. ``completed`` takes what is missing of the lattice instead. (This project.)
    """

    reference: ClassVar = "liu2018"
    order: ClassVar = 0
    needs: ClassVar = (SECOND_MOMENT, SURFACE_SHARE, CROWDING)
    completes: ClassVar = True

    floor: float = Parameter(default=0.3, gt=0.0, le=1.0)
    """Least eigenvalue of the matrix that is inverted [1]."""

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs,
        phi: str = "pressure", out: str = "pressure_gradient", over: int = ANY, view: PairView | None = None,
        dt: float = 0.0, moved: bool = True,
    ) -> None:  # fmt: skip
        """Write the gradient of ``phi`` at fluid rows into ``out``."""
        pair_sums((crowding_sum(self, lattice), second_moment_sum(self, lattice, over)), particles, pairs)
        pair_sum(
            difference, particles, pairs, out=out, weight=self.weight, re=self.radius(lattice), over=over,
            arguments=(lattice.dimension / self.n0(lattice), self.floor, lattice.spacing), fields={"value": phi},
            view=view,
        )  # fmt: skip
