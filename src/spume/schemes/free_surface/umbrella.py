"""Free surface by a scan of the cone around the normal."""

from typing import Any, ClassVar

from pydantic import Field as Parameter

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, pair_max, pair_sum, pair_term, row_map, row_term
from spume.particles import ANY, FLUID, WALL, Field, Particles
from spume.schemes.correction import smallest_eigenvalue
from spume.schemes.free_surface.base import SURFACE_SHARE, FreeSurface, as_share
from spume.schemes.normal import NORMAL_FIELDS, surface_normals
from spume.schemes.operator import Operator

SCAN_FIELDS = (
    *NORMAL_FIELDS,
    Field("umbrella", (), "1", "1 where a neighbour lies in the cone around the normal", int),
)


def _scaled(a, total, scale):  # type: ignore[no-untyped-def]
    return scale * total


@pair_term(shape=("d", "d"), finish=_scaled)
def moment(a, b, r, w, scale):  # type: ignore[no-untyped-def]
    return r.outer_product(r) * (w / r.dot(r))


@row_term(reads=("arrangement",))
def least(a):  # type: ignore[no-untyped-def]
    return smallest_eigenvalue(a.arrangement)


def _found(a, largest, h):  # type: ignore[no-untyped-def]
    return kernels.qd.cast(largest > 0.5, kernels.i32)


@pair_term(reads=("surface_normal",), finish=_found)
def in_cone(a, b, r, w, h):  # type: ignore[no-untyped-def]
    n = a.surface_normal
    length = r.norm()
    inside = 0.0
    if length >= 1.4142135623730951 * h:
        inside = kernels.qd.cast((r - h * n).norm() < h, kernels.qd.i32)
    elif r.dot(n) > 0.7071067811865476 * length:
        inside = 1.0
    return inside


def scan(operator: Operator, lattice: Lattice, particles: Particles, pairs: Pairs, where: str = "") -> None:
    """Write ``surface_normal`` and ``umbrella`` of fluid and wall rows: 1 where any neighbour lies under the umbrella.

    With h = re/2 and T = x_i + h n_i that is, for a neighbour j (review Eq. 31): |x_ji| >= sqrt(2) h and |x_jT| < h; or
    |x_ji| < sqrt(2) h and the angle between x_ji and n below 45 degrees. In 2D the print has
    |n . x_jT| + |t . x_jT| < h in the second line, which is the same cone. ``where`` names a field that is positive at
    the rows that are scanned, if not all are.
    """
    both = FLUID | WALL
    surface_normals(operator, lattice, particles, pairs, rows=both, where=where)
    pair_max(
        in_cone, particles, pairs, out="umbrella", weight=operator.weight, re=operator.radius(lattice), rows=both,
        over=ANY, arguments=(0.5 * operator.radius(lattice),), where=where,
    )  # fmt: skip


@row_term(reads=("least_eigenvalue", "umbrella"))
def by_both_stages(a, lower, upper):  # type: ignore[no-untyped-def]
    surface = 1 - a.umbrella
    if a.least_eigenvalue < lower:
        surface = 1
    elif a.least_eigenvalue > upper:
        surface = 0
    return surface


class Umbrella(FreeSurface, name="umbrella"):
    """A row is on the free surface if no neighbour lies under an umbrella along its normal (Marrone 2010; review
    Eq. 31).

    First by the least eigenvalue of M_i = d/n0 sum_j W r (x) r/r^2, which is 1 inside: below ``lower`` a row is
    on the surface, above ``upper`` it is not. In between it is, unless any neighbour (walls included) lies in
    the region of height 2 h around the normal: a cone of 45 degrees to both sides up to sqrt(2) h, a ball of
    radius h beyond; h = re/2. In the print "free surface" and "not" of the scan are mixed up. Finds surfaces by
    their shape, so disorder inside costs few errors; a cavity of one missing particle is none.
    """

    ids: ClassVar = ("E5",)
    reference: ClassVar = "marrone2010"
    needs: ClassVar = (
        SURFACE_SHARE,
        *SCAN_FIELDS,
        Field("arrangement", ("d", "d"), "1", "second moment of a row's neighbours, the unit matrix on the lattice"),
        Field("least_eigenvalue", (), "1", "least eigenvalue of the second moment of a row's neighbours"),
    )

    lower: float = Parameter(default=0.2, ge=0.0, le=1.0)
    """Least eigenvalue below which a row is on the surface [1]."""
    upper: float = Parameter(default=0.75, ge=0.0, le=1.0)
    """Least eigenvalue above which a row is not [1]."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any) -> None:
        """Write ``free_surface`` (1 or 0) and ``surface_share`` of fluid and wall rows."""
        both = FLUID | WALL
        pair_sum(
            moment, particles, pairs, out="arrangement", weight=self.weight, re=self.radius(lattice), rows=both,
            over=ANY, arguments=(lattice.dimension / self.n0(lattice),),
        )  # fmt: skip
        row_map(least, particles, out="least_eigenvalue", rows=both)
        scan(self, lattice, particles, pairs)
        row_map(by_both_stages, particles, out="free_surface", rows=both, arguments=(self.lower, self.upper))
        row_map(as_share, particles, out="surface_share", rows=both)
