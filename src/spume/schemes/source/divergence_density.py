"""Divergence of velocity plus a relaxed density term: smooth pressure and no drift of the volume."""

from typing import Any, ClassVar

from pydantic import Field as Parameter

from spume.lattice import Lattice
from spume.pairs import Pairs, row_map, row_term
from spume.particles import FLUID, WALL, Particles
from spume.schemes.source.base import Source, volume_error


@row_term(reads=("divergence", "number_density", "surface_share"))
def relaxed(a, n0, dt, gamma):  # type: ignore[no-untyped-def]
    error = volume_error(a.number_density, n0, a.surface_share)
    return a.divergence / dt - gamma * error / (dt * dt)


class DivergenceDensity(Source, name="divergence-density"):
    """div(grad(P)/rho) = div(u*)/dt + gamma (n0 - n^k)/(n0 dt^2) (Tanaka & Masunaga 2010; review Eq. 30).

    The usual choice: as smooth as the divergence alone, and the volume does not drift.
    """

    ids: ClassVar = ("S6",)
    reference: ClassVar = "tanaka2010"
    instant: ClassVar = "k"
    from_velocity: ClassVar = True

    gamma: float = Parameter(default=0.05, ge=0.0, le=1.0)
    """Share of the density error that one step corrects [1]."""

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs, dt: float,
        divergence: Any, number_density: Any, mirror: bool,
    ) -> None:  # fmt: skip
        """Write ``source`` of fluid and wall rows."""
        divergence(lattice, particles, pairs, out="divergence", mirror=mirror)
        row_map(
            relaxed, particles, out="source", rows=FLUID | WALL,
            arguments=(number_density.n0(lattice), dt, self.gamma),
        )  # fmt: skip
