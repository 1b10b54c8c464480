"""Free surface by the divergence of the position, confirmed by a scan."""

from typing import Any, ClassVar

from pydantic import Field as Parameter

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, row_map, row_term
from spume.particles import FLUID, WALL, Particles
from spume.schemes.free_surface.base import SURFACE_SHARE, FreeSurface, as_share
from spume.schemes.free_surface.divergence_of_position import POSITION_DIVERGENCE, position_divergence
from spume.schemes.free_surface.umbrella import SCAN_FIELDS, scan


@row_term(reads=("position_divergence",))
def candidate(a, limit):  # type: ignore[no-untyped-def]
    return kernels.qd.select(a.position_divergence < limit, 1.0, 0.0)


@row_term(reads=("surface_share", "umbrella"))
def candidate_and_open(a):  # type: ignore[no-untyped-def]
    return kernels.qd.cast(a.surface_share > 0.0 and a.umbrella == 0, kernels.i32)


class Hybrid(FreeSurface, name="hybrid"):
    """Candidates have div r < share d; those under whose umbrella no neighbour lies are the surface (Wang 2019).

    div r as in ``divergence-of-position`` with a generous limit, the umbrella as in ``umbrella``. The first
    stage spares the scan the rows whose normal means nothing, deep inside; the second one rejects those that
    only lack neighbours by disorder. The surest of the sharp detections. The fields ``umbrella`` and ``surface_normal``
    are those of candidates.
    """

    ids: ClassVar = ("E6",)
    reference: ClassVar = "wang2019"
    unused: ClassVar = {"weight": "the kernel of div r is Wendland's, and the scan asks where neighbours lie"}
    needs: ClassVar = (SURFACE_SHARE, POSITION_DIVERGENCE, *SCAN_FIELDS)

    share: float = Parameter(default=0.9, gt=0.0, le=1.5)
    """Part of d below which the divergence of the position makes a row a candidate [1]."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any) -> None:
        """Write ``free_surface`` (1 or 0) and ``surface_share`` of fluid and wall rows."""
        position_divergence(self, lattice, particles, pairs)
        # The share holds what it will be at most, until the scan has told.
        row_map(
            candidate, particles, out="surface_share", rows=FLUID | WALL, arguments=(self.share * lattice.dimension,)
        )
        scan(self, lattice, particles, pairs, where="surface_share")
        row_map(candidate_and_open, particles, out="free_surface", rows=FLUID | WALL)
        row_map(as_share, particles, out="surface_share", rows=FLUID | WALL)
