"""The source of three terms: acceleration, rate and error of the number density."""

from typing import Any, ClassVar

from pydantic import Field as Parameter

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, row_map, row_term
from spume.particles import FLUID, WALL, Field, Particles
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.source.base import NUMBER_DENSITY_RATE, NUMBER_DENSITY_START, Source, volume_error

DT_BEFORE = Field("dt_before", (), "s", "time step before this one, 0 for a row that has seen none", restart=True)


@row_term(reads=("number_density", "number_density_start", "dt_before"))
def rate_before(a):  # type: ignore[no-untyped-def]
    change = a.number_density - a.number_density_start
    return kernels.qd.select(a.dt_before > 0.0, change / max(a.dt_before, 1e-30), 0.0 * change)


@row_term(reads=("number_density",))
def density_at_start(a):  # type: ignore[no-untyped-def]
    return a.number_density


@row_term()
def this_step(a, dt):  # type: ignore[no-untyped-def]
    return dt


@row_term(reads=("number_density", "number_density_start", "number_density_rate", "surface_share"))
def three_terms(a, n0, dt, alpha, beta):  # type: ignore[no-untyped-def]
    rate = (a.number_density - a.number_density_start) / dt
    error = volume_error(a.number_density_start, n0, a.surface_share)
    return -((rate + (alpha - 1.0) * a.number_density_rate) / n0 + beta * error / dt) / dt


class ThreeTerm(Source, name="three-term"):
    """div(grad(P)/rho) = -1/(n0 dt) {(n* - n^k)/dt + (alpha - 1) (n^k - n^(k-1))/dt' + beta (n^k - n0)/dt}.

    (Kondo & Koshizuka 2011; review Eq. 28 with the minus that Eq. 6 asks for.) dt' is the step before this one;
    with dt' = dt the first two are (n* - 2 n^k + n^(k-1))/dt + alpha (n^k - n^(k-1))/dt. A row without a step before
    takes the middle part as zero. n^k is summed after correction and shifting of the step before.
    The deviation of the density, split: alpha of its rate and beta of its value are corrected
    in a step, 0 <= beta <= alpha <= 1; alpha = beta = 1 is the density source, inside an incompressible fluid. With
    ``compressibility`` it is not: this source draws to P_0 = P^k whatever beta is, the density source to 0, and beta
    restores n0 where a fluid under pressure would have n0 (1 + alpha_c P). The smaller alpha and beta are the less
    disorder becomes pressure; beta = 0 lets the volume drift. Near the free surface a density below
    n0 is left out of the last part: neighbours are missing there.
    """

    ids: ClassVar = ("S3",)
    reference: ClassVar = "kondo2011"
    instant: ClassVar = "*"
    history: ClassVar = ("k-1", "k")
    from_velocity: ClassVar = False
    needs: ClassVar = (*Source.needs, NUMBER_DENSITY_START, NUMBER_DENSITY_RATE, DT_BEFORE, SURFACE_SHARE)

    alpha: float = Parameter(default=0.2, ge=0.0, le=1.0)
    """Share of the rate of change of the density that one step corrects [1]."""
    beta: float = Parameter(default=0.05, ge=0.0, le=1.0)
    """Share of the density error that one step corrects [1]."""

    def remember(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any, mirror: bool) -> None:
        """Take down n^k and (n^k - n^(k-1))/dt'."""
        number_density(lattice, particles, pairs)
        row_map(rate_before, particles, out="number_density_rate", rows=FLUID | WALL)
        row_map(density_at_start, particles, out="number_density_start", rows=FLUID | WALL)

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs, dt: float,
        divergence: Any, number_density: Any, mirror: bool,
    ) -> None:  # fmt: skip
        """Write ``source`` of fluid and wall rows."""
        row_map(
            three_terms, particles, out="source", rows=FLUID | WALL,
            arguments=(number_density.n0(lattice), dt, self.alpha, self.beta),
        )  # fmt: skip
        row_map(this_step, particles, out="dt_before", rows=FLUID | WALL, arguments=(dt,))
