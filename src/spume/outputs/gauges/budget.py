"""Gauges of global sums: energy, momentum, volume."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from spume.outputs import budgets
from spume.outputs.gauge import Gauge
from spume.outputs.snapshot import Snapshot


def _per_width(unit: str, dimension: int) -> str:
    return unit if dimension == 3 else f"{unit}/m"


class Energy(Gauge, name="energy"):
    """Mechanical energy of the fluid.

    Kinetic Σ m |u|² / 2, potential −Σ m g·x (zero at the origin of coordinates; with a central gravity
    Σ m k |x − c|²/2, zero in its focus), and their sum, with m = ρ l0^d; per metre of width in 2D.
    """

    reads: ClassVar[tuple[str, ...]] = ("position", "velocity", "density", "kind")

    def columns(self, dimension: int) -> dict[str, str]:
        unit = _per_width("J", dimension)
        return {"total": unit, "kinetic": unit, "potential": unit}

    def measure(self, snapshot: Snapshot) -> dict[str, float]:
        kinetic = budgets.kinetic_energy(snapshot)
        potential = budgets.potential_energy(snapshot)
        return {"total": kinetic + potential, "kinetic": kinetic, "potential": potential}


class Momentum(Gauge, name="momentum"):
    """Momentum of the fluid, Σ m u with m = ρ l0^d; per metre of width in 2D."""

    reads: ClassVar[tuple[str, ...]] = ("velocity", "density", "kind")

    def columns(self, dimension: int) -> dict[str, str]:
        unit = _per_width("kg m/s", dimension)
        return {f"momentum_{axis}": unit for axis in "xyz"[:dimension]}

    def measure(self, snapshot: Snapshot) -> dict[str, float]:
        return {f"momentum_{a}": float(p) for a, p in zip("xyz", budgets.momentum(snapshot), strict=False)}


class Volume(Gauge, name="volume"):
    """Volume that the fluid fills, Σ l0^d n0 / n_i over interior rows and l0^d per surface row.

    Unlike N l0^d, which is constant, it shows a drift of the volume; an area in 2D. In a box it is that of the rows
    whose centres lie there: behind a wall the water that has overtopped it, whose slope is the discharge.
    """

    reads: ClassVar[tuple[str, ...]] = ("position", "number_density", "free_surface", "kind")

    lower: tuple[float, ...] | None = None
    """Lower corner of the box [m]; default: without a limit below."""
    upper: tuple[float, ...] | None = None
    """Upper corner of the box [m]; default: without a limit above."""

    def columns(self, dimension: int) -> dict[str, str]:
        return {"volume": f"m^{dimension}"}

    def check(self, snapshot: Snapshot) -> None:
        d = snapshot.dimension
        corners = [
            np.full(d, default) if corner is None else self.vector(key, corner, d)
            for key, corner, default in (("lower", self.lower, -np.inf), ("upper", self.upper, np.inf))
        ]
        if np.any(corners[0] >= corners[1]):
            raise ValueError(f"gauge {self.name!r}: lower = {self.lower}, upper = {self.upper}: lower must be less")

    def measure(self, snapshot: Snapshot) -> dict[str, float]:
        lower = -np.inf if self.lower is None else np.asarray(self.lower)
        upper = np.inf if self.upper is None else np.asarray(self.upper)
        return {"volume": budgets.volume(snapshot, lower, upper)}
