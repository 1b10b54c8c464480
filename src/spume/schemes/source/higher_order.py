"""The higher-order source: the rate of change of the number density by the velocities."""

from typing import Any, ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs, pair_sum, pair_term
from spume.particles import FLUID, WALL, Particles
from spume.schemes.source.base import Source
from spume.schemes.source.rate import number_density_rate


def _as_source(a, rate, scale, mirror):  # type: ignore[no-untyped-def]
    return -scale * rate


@pair_term(reads=("velocity", "kind", "to_surface"), finish=_as_source)
def rate(a, b, r, w, scale, mirror):  # type: ignore[no-untyped-def]
    return number_density_rate(a, b, r, w, mirror)


class HigherOrder(Source, name="higher-order"):
    """div(grad(P)/rho) = -(Dn/Dt)*/(n0 dt), Dn/Dt = sum_j dW/dr r_ij . u_ij/r (HS, Khayyer & Gotoh 2009; Eq. 27).

    With W = re/r - 1 that is +1/(n0 dt) sum_j re/r^3 r_ij . u*_ij: the print of Eq. 27 has r_ij in the place of re, and
    the wrong sign. Other weight functions bring their own derivative. For a uniform compression it gives
    div(u)/dt times -sum_j r_j W'(r_j)/(d n0). With the weight ``inverse`` of n that is 1.42 in 2D and 1.07 in 3D at
    re = 2.1 l0, and the Laplacian that fits is the ``consistent`` higher-order one of the same re, which carries the
    same factor. Other weights have other factors, ``gaussian`` 2.29 and 1.70, and no Laplacian that shares them.
    Smoother in time than the density, for it reads velocities and not positions; errors of the volume are not
    corrected and accumulate, unlike with the error-compensating source.
    """

    ids: ClassVar = ("S2",)
    reference: ClassVar = "khayyer2009"
    instant: ClassVar = "*"
    from_velocity: ClassVar = True
    of_slope: ClassVar = True

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs, dt: float,
        divergence: Any, number_density: Any, mirror: bool,
    ) -> None:  # fmt: skip
        """Write ``source`` of fluid and wall rows."""
        pair_sum(
            rate, particles, pairs, out="source", weight=number_density.weight.derivative(),
            re=number_density.radius(lattice), rows=FLUID | WALL,
            arguments=(1.0 / (number_density.n0(lattice) * dt), float(mirror)),
        )  # fmt: skip
