"""The higher-order source with two parts that compensate errors of the step before, free of parameters."""

from typing import Any, ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs, pair_sum, pair_term, row_map, row_term
from spume.particles import FLUID, WALL, Particles
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.source.base import NUMBER_DENSITY_RATE, NUMBER_DENSITY_START, Source, volume_error
from spume.schemes.source.rate import number_density_rate


def _as_source(a, rate, n0, dt, mirror):  # type: ignore[no-untyped-def]
    error = volume_error(a.number_density_start, n0, a.surface_share)
    before = a.number_density_rate / n0
    return -(rate / n0 + abs(error) * before + abs(dt * before) * error / dt) / dt


@pair_term(
    reads=("velocity", "kind", "to_surface", "number_density_start", "number_density_rate", "surface_share"),
    finish=_as_source,
)
def rate(a, b, r, w, n0, dt, mirror):  # type: ignore[no-untyped-def]
    return number_density_rate(a, b, r, w, mirror)


@pair_term(reads=("velocity", "kind", "to_surface"))
def rate_at_start(a, b, r, w, mirror):  # type: ignore[no-untyped-def]
    return number_density_rate(a, b, r, w, mirror)


@row_term(reads=("number_density",))
def density_at_start(a):  # type: ignore[no-untyped-def]
    return a.number_density


class ErrorCompensating(Source, name="error-compensating"):
    """dt div(grad(P)/rho) = -{(Dn/Dt)*/n0 + |e| (Dn/Dt)^k/n0 + |dt (Dn/Dt)^k/n0| e/dt}, e = (n^k - n0)/n0.

    (ECS, Khayyer & Gotoh 2011; review Eq. 29 with the minus that Eq. 6 asks for.) Dn/Dt = sum_j dW/dr r_ij . u_ij/r.
    The first part is the higher-order source, the others take back what the step before left of motion and of
    volume, weighted with each other: nothing to choose. In a fluid at rest (Dn/Dt)^k vanishes and with it
    the correction, so a slow drift of the volume is not restored; then prefer three-term or divergence-density.
    Near the free surface a density below n0 is left out of e: neighbours are missing there. Its size, and the Laplacian
    that fits, are those of ``higher-order``.
    """

    ids: ClassVar = ("S4",)
    reference: ClassVar = "khayyer2011"
    instant: ClassVar = "*"
    history: ClassVar = ("k",)
    from_velocity: ClassVar = True
    of_slope: ClassVar = True
    needs: ClassVar = (*Source.needs, NUMBER_DENSITY_START, NUMBER_DENSITY_RATE, SURFACE_SHARE)

    def remember(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any, mirror: bool) -> None:
        """Take down n^k and (Dn/Dt)^k."""
        number_density(lattice, particles, pairs)
        row_map(density_at_start, particles, out="number_density_start", rows=FLUID | WALL)
        pair_sum(
            rate_at_start, particles, pairs, out="number_density_rate", weight=number_density.weight.derivative(),
            re=number_density.radius(lattice), rows=FLUID | WALL, arguments=(float(mirror),),
        )  # fmt: skip

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs, dt: float,
        divergence: Any, number_density: Any, mirror: bool,
    ) -> None:  # fmt: skip
        """Write ``source`` of fluid and wall rows."""
        pair_sum(
            rate, particles, pairs, out="source", weight=number_density.weight.derivative(),
            re=number_density.radius(lattice), rows=FLUID | WALL,
            arguments=(number_density.n0(lattice), dt, float(mirror)),
        )  # fmt: skip
