"""The corrected gradient with images of the fluid beyond the free surface."""

from typing import ClassVar

from pydantic import Field as Parameter

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, PairView, pair_sum, pair_sums, pair_term
from spume.particles import ANY, FLUID, Particles
from spume.pressure.matrix import WALL_ACCELERATION
from spume.schemes.correction import (
    SECOND_MOMENT,
    WALL_MOMENT,
    along_normal,
    identity_like,
    missing_to,
    second_moment_sum,
    symmetric_matrix,
    wall_moment_sum,
)
from spume.schemes.gradient.base import Gradient
from spume.schemes.surface_images import IMAGE_FIELDS, surface_images


def _corrected(a, total, scale, floor, l0, normals):  # type: ignore[no-untyped-def]
    matrix = scale * symmetric_matrix(a.second_moment - normals * a.wall_moment)
    total *= scale
    if a.surface_share > 0.0:
        length = 2.0 * a.surface_share * a.surface_distance / max(a.images.norm(), 1e-9 / l0)
        matrix += length * a.images.outer_product(a.images)
        total += 2.0 * a.surface_share * (a.value - a.air_pressure) * a.images
    missing = missing_to(matrix, floor)
    # Half of the pressure that a surface at rest has at the centres of its rows, and more, carries all of the weight.
    weight = a.density * a.acceleration
    at_rest = min(max((a.value - a.air_pressure) / max(0.25 * l0 * weight.norm(), 1e-30), 0.0), 1.0) * weight
    return (matrix + missing * identity_like(matrix)).inverse() @ (total + missing * at_rest)


_READ = (
    "value", "kind", "to_surface", "second_moment", "wall_moment", "surface_share", "images", "surface_distance",
    "density", "acceleration", "air_pressure",
)  # fmt: skip


@pair_term(reads=_READ, shape=("d",), finish=_corrected)
def difference(a, b, r, w, scale, floor, l0, normals):  # type: ignore[no-untyped-def]
    return (b.value - a.value) * (w / r.dot(r)) * along_normal(b, r, normals)


@pair_term(reads=(*_READ, "wall_acceleration"), shape=("d",), finish=_corrected)
def difference_beyond_rest(a, b, r, w, scale, floor, l0, normals):  # type: ignore[no-untyped-def]
    at_rest = a.density * b.wall_acceleration.dot(r)
    wall = at_rest * r + (b.value - a.value - at_rest) * along_normal(b, r, 1.0)
    return kernels.qd.select(b.kind == FLUID, (b.value - a.value) * r, wall) * (w / r.dot(r))


class Imaged(Gradient, name="imaged"):
    """<grad P>_i = C_i [d/n0 sum_j (P_j - P_i) W r_ij/r^2 + 2 theta_i P_i b_i].

    C_i = [M_i + 2 theta_i delta_i b_i (x) b_i/|b_i|]^-1 with theta_i the row's share in the free surface, b_i the
    vector of its images, delta_i its distance from the surface (`surface_images`). The images, at -b_i all together,
    have the pressure that vanishes at delta_i outside and goes on with the slope P_i/delta_i. For a solid row j that
    says what lies along the normal n of its wall (``neumann``, with ``normals``), n n . r_ij stands in the place of
    r_ij, here and in M_i: along a wall the gradient is the fluid's. Without ``normals`` that is so for what differs
    from fluid at rest, and not in M_i: what few neighbours say is not multiplied then.

    Where an eigenvalue of the bracket is less than ``floor``, it is given f I more, as much as makes up for that, and
    the sum f kappa_i rho_i a_i with kappa_i = min(1, P_i/(rho_i |a_i| l0/4)), a_i being the acceleration by all else
    that acts on the row: in a direction of which the neighbours say little the pressure carries the row, as in fluid
    at rest, if it is as high as there. A floor as low as 0.3 multiplies what one neighbour says: rows that run along a
    wall against others are driven on into them.

    Exact for linear fields on any arrangement inside the fluid, beside such walls too, and for
    those that vanish there on any arrangement of its surface, so that rows of a surface that is stretched or crowded
    are still held. The same images as those of the ``free_surface`` of that name. ``completed`` takes what is missing
    of the lattice instead. (This project.)
    """

    reference: ClassVar = ()
    order: ClassVar = 0
    needs: ClassVar = (SECOND_MOMENT, WALL_MOMENT, WALL_ACCELERATION, *IMAGE_FIELDS)
    completes: ClassVar = True
    of_air: ClassVar = True

    floor: float = Parameter(default=0.45, gt=0.0, le=1.0)
    """Least eigenvalue of the matrix that is inverted [1]."""
    normals: bool = True
    """Take of a wall how the pressure changes along its normal; false: along it too, as in fluid at rest."""

    @property
    def of_normals(self) -> bool:  # type: ignore[override]
        """Whether a wall that is asked for it may say how the pressure changes along its normal, and nothing else."""
        return self.normals

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs,
        phi: str = "pressure", out: str = "pressure_gradient", over: int = ANY, view: PairView | None = None,
        dt: float = 0.0, moved: bool = True,
    ) -> None:  # fmt: skip
        """Write the gradient of ``phi`` at fluid rows into ``out``."""
        surface_images(self, lattice, particles, pairs)
        pair_sums((second_moment_sum(self, lattice, over),), particles, pairs)
        normals = view is not None and view.of_normals
        if normals:
            pair_sums((wall_moment_sum(self, lattice),), particles, pairs)
        term = difference_beyond_rest if view is not None and view.beyond_rest else difference
        pair_sum(
            term, particles, pairs, out=out, weight=self.weight, re=self.radius(lattice), over=over,
            arguments=(lattice.dimension / self.n0(lattice), self.floor, lattice.spacing, float(normals)),
            fields={"value": phi}, view=view,
        )  # fmt: skip
