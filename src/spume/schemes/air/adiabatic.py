"""Trapped air that is compressed without losing heat."""

from collections.abc import Mapping
from math import inf, pi, sqrt
from typing import ClassVar

from pydantic import Field as Parameter

from spume.lattice import Lattice
from spume.particles import FLUID, Particles
from spume.schemes.air.base import Air
from spume.schemes.surface_images import AIR_PRESSURE
from spume.voids import Voids

_OF_PERIOD = 0.1
"""Part of a bubble's period that a step may last at most."""


class Adiabatic(Air, name="adiabatic"):
    """P = P_0 [(V_0/V)^gamma - 1] in each enclosed void, V its volume and V_0 that of its air at the pressure P_0.

    A void is what on a grid of cells of l0 no row fills; enclosed is one that touches fluid and neither the outside
    nor, in a closed tank, is the largest of all. Its air is what was in it when it closed, at P_0. Voids that
    part share their air by volume, those that join add theirs, and one that opens loses it. V follows the motion:
    each step adds by how much the cells of the void have been emptied, and a small share of what separates it from the
    volume that is measured anew. That is V itself where it is less than half or more than twice as large. The surface
    rows around a void have its pressure outside (``air_pressure``), mean of the voids within 2.1 l0. It acts
    explicitly, in the middle of the leapfrog, which neither damps nor excites a bubble whose period is longer than pi
    steps; steps are at most a tenth of it. Smaller voids are empty.

    (This project.)
    """

    reference: ClassVar = ()

    pressure: float = Parameter(default=101325.0, gt=0.0)
    """Absolute pressure P_0 of the air outside [Pa]."""
    exponent: float = Parameter(default=1.4, ge=1.0, le=2.0)
    """gamma, the ratio of the heat capacities [1]; 1 is isothermal."""
    smallest: float = Parameter(default=5.0, ge=2.0)
    """Edge of the smallest void that holds air, as a multiple of l0 [1]: as large as its cube, in 2D its square."""
    relaxation: float = Parameter(default=0.05, ge=0.0, le=1.0)
    """Share of the difference to the measured volume that one step makes up for [1]."""

    def __call__(
        self, lattice: Lattice, particles: Particles, voids: Voids, periods: Mapping[int, float]
    ) -> dict[str, float]:
        """Write ``air_pressure``; count ``air_pockets``, and give the largest pressure in one [Pa]."""
        least = (self.smallest * lattice.spacing) ** lattice.dimension
        now = voids.find(lattice.spacing, particles, periods, least)
        carried, parts = voids.carried(now), voids.parts(now) if now.volumes else {}
        whole: dict[int, float] = {}
        for (_, before), part in parts.items():
            whole[before] = whole.get(before, 0.0) + part
        pockets: dict[int, tuple[float, float]] = {}
        for number, volume in now.volumes.items():
            if volume < least:
                continue
            air = moved = 0.0
            for (present, before), part in parts.items():
                if present != number:
                    continue
                share = part / whole[before]
                air += voids.air[before][0] * share if before else part
                moved += carried[before] * share if before else part
            if not 0.5 * volume < moved < 2.0 * volume:
                moved = volume
            pockets[number] = (air, moved + self.relaxation * (volume - moved))
        voids.keep(now, pockets)
        pressures = {number: self._over(*pocket) for number, pocket in pockets.items()}
        voids.show(pressures, now, particles, AIR_PRESSURE.name, reach=2.1)
        return {"air_pockets": len(pockets), "air_pressure": max(pressures.values(), key=abs, default=0.0)}

    def max_dt(self, lattice: Lattice, particles: Particles, voids: Voids) -> float:
        """Return a tenth of the period of the smallest bubble (Minnaert 1933, in 2D without the logarithm)."""
        if not voids.air:
            return inf
        shortest, d, density = inf, lattice.dimension, particles.smallest("density", FLUID)
        for air, volume in voids.air.values():
            radius = (volume * 0.75 / pi) ** (1.0 / 3.0) if d == 3 else sqrt(volume / pi)
            stiffness = d * self.exponent * (self.pressure + self._over(air, volume))
            shortest = min(shortest, 2.0 * pi * radius * sqrt(density / max(stiffness, 1e-30)))
        return _OF_PERIOD * shortest

    def _over(self, air: float, volume: float) -> float:
        """Return the pressure above that of the air outside [Pa]."""
        return float(self.pressure * ((air / volume) ** self.exponent - 1.0))
