"""Divergence of velocity plus a relaxed density term: smooth pressure and no drift of the volume."""

from typing import Any, ClassVar

from pydantic import Field as Parameter

from spume.kernels import qd
from spume.lattice import Lattice
from spume.pairs import Pairs, PairSum, RowMap, pair_sums, pair_term, row_maps, row_term
from spume.particles import FLUID, WALL, Field, Particles
from spume.schemes.source.base import Source, volume_error

VOLUME_ERROR = Field("volume_error", (), "1", "(n - n0)/n0, without what is missing beyond the surface")
_AROUND = (
    Field("error_around", (), "1", "sum of W times the volume error of the fluid near a row", scratch="volume"),
    Field("weight_around", (), "1", "sum of W over the fluid near a row", scratch="volume"),
)


@row_term(reads=("number_density", "surface_share"))
def own_error(a, n0):  # type: ignore[no-untyped-def]
    return volume_error(a.number_density, n0, a.surface_share)


@row_term(reads=("number_density", "images_density", "surface_share"))
def own_error_with_images(a, n0):  # type: ignore[no-untyped-def]
    # What images add is a guess on the surface itself; more neighbours than the lattice has are none.
    completed = (1.0 - a.surface_share) * (a.number_density + a.images_density - n0) / n0
    return qd.select(a.number_density > n0, max(a.number_density / n0 - 1.0, completed), completed)


@pair_term(reads=("volume_error",))
def error_of_neighbour(a, b, r, w):  # type: ignore[no-untyped-def]
    return w * b.volume_error


@pair_term()
def weight_of_neighbour(a, b, r, w):  # type: ignore[no-untyped-def]
    return w


@row_term(reads=("volume_error", "error_around", "weight_around"))
def mean_error(a):  # type: ignore[no-untyped-def]
    return (a.volume_error + a.error_around) / (1.0 + a.weight_around)


@row_term(reads=("divergence", "volume_error"))
def relaxed(a, dt, gamma):  # type: ignore[no-untyped-def]
    return a.divergence / dt - gamma * a.volume_error / (dt * dt)


class DivergenceDensity(Source, name="divergence-density"):
    """div(grad(P)/rho) = div(u*)/dt + gamma (n0 - n^k)/(n0 dt^2) (Tanaka & Masunaga 2010; review Eq. 30).

    The usual choice: as smooth as the divergence alone, and the volume does not drift.
    """

    ids: ClassVar = ("S6",)
    reference: ClassVar = "tanaka2010"
    instant: ClassVar = "k"
    from_velocity: ClassVar = True

    needs: ClassVar = (*Source.needs, VOLUME_ERROR, *_AROUND)

    gamma: float = Parameter(default=0.05, ge=0.0, le=1.0)
    """Share of the density error that one step corrects [1]."""
    smoothed: bool = False
    """Take the mean of the error over a row and its fluid neighbours, weighted with 1 and W: one row is no volume."""

    def needed(self) -> tuple[Field, ...]:
        """Return the needed fields, without those that only ``smoothed`` uses."""
        return tuple(f for f in self.needs if self.smoothed or f not in _AROUND)

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs, dt: float,
        divergence: Any, number_density: Any, mirror: bool,
    ) -> None:  # fmt: skip
        """Write ``source`` of fluid and wall rows."""
        n0 = number_density.n0(lattice)
        errors = [RowMap(own_error, "volume_error", FLUID | WALL, (n0,))]
        if "images_density" in particles.fields:  # of a free surface with images
            errors.append(RowMap(own_error_with_images, "volume_error", FLUID, (n0,)))
        sources = [RowMap(relaxed, "source", FLUID | WALL, (dt, self.gamma))]
        row_maps(errors, particles)
        if self.smoothed:
            around = PairSum(
                (error_of_neighbour, weight_of_neighbour), ("error_around", "weight_around"), number_density.weight,
                number_density.radius(lattice), over=FLUID,
            )  # fmt: skip
            pair_sums((*divergence.sums_of_velocity(lattice, particles, pairs, mirror), around), particles, pairs)
            sources.insert(0, RowMap(mean_error, "volume_error", FLUID))
        divergence(lattice, particles, pairs, out="divergence", mirror=mirror)
        row_maps(sources, particles)
