"""Gauge of the free-surface elevation."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from spume.outputs.connected import main_body
from spume.outputs.gauge import Riding
from spume.outputs.snapshot import FLUID, Snapshot

_RADIUS = 2.5  # of the smoothing kernel [l0]: a single drop stays below one half everywhere
_STEPS = 8  # heights tried per l0
_BELOW = 2.5, 4.5  # where a surface compares itself with the fluid below it [l0]
_STEEPEST = 0.7  # cosine of the angle between the line and gravity at which a surface can still be met
_DENSEST = 1.25  # of that fluid, and the inverse of the thinnest


class Elevation(Riding, name="elevation"):
    """Elevation of the free surface on a line along the last axis, down which gravity must point.

    The surface is where the filled fraction of space falls to half of what it is below,

        χ(x) = (Σ_fluid W + Σ_floor W) l0^d / (1 − Σ_sides W l0^d) = χ_below/2,

    W = (1 − r²/R²)³ over its integral, R = 2.5 l0, χ_below the mean of χ from 2.5 to 4.5 l0 below χ = 1/2 as far as
    there is fluid, and 1 where there is none. χ_below differs from 1 by the arrangement alone: rows beside a
    wall that are nearer to it than half a row by 0.05 l0 would lift the surface χ = 1/2 by 0.05 l0. On a
    lattice, stretched or not, the surface is the plane half a row above the outermost centres, to 0.006 l0. Of a
    wall's column the topmost row, if it is nearer to it by 0.08 l0 than those below, lifts it there by 0.03 l0.
    Solid rows below the water (their wetted side looks up) count as filled, so that a thin layer is seen; those
    beside and above it count as space that is not there, so that a gauge may stand at a wall. A single drop
    fills less than half of the kernel anywhere and is not seen.

    Three answers, which agree for a plain surface:

    * ``elevation``: the highest surface of the main (largest connected) body of fluid;
    * ``first_surface``: the lowest surface met from below, under an overturning jet or at a bubble;
    * ``wetted_length``: the length of line in the water, which a wire probe measures, above the
      lowest wet point.

    On a body the line is fixed to it and turns with it, as a wire stretched in a tank does. It looks through periodic
    boundaries.

    On a dry floor ``elevation`` and ``first_surface`` are the floor's; without floor and fluid NaN.
    """

    reads: ClassVar[tuple[str, ...]] = ("position", "kind", "to_surface")

    at: tuple[float, ...]
    """Where the line stands [m]: ``[x]`` in 2D, ``[x, y]`` in 3D."""

    def columns(self, dimension: int) -> dict[str, str]:
        return {"elevation": "m", "first_surface": "m", "wetted_length": "m"}

    def check(self, snapshot: Snapshot) -> None:
        super().check(snapshot)
        d = snapshot.dimension
        if len(self.at) != d - 1:
            raise ValueError(
                f"gauge {self.name!r}: at = {list(self.at)}: {d - 1} number{'s' if d == 3 else ''} in {d}D"
            )
        if snapshot.up[-1] < _STEEPEST:
            raise ValueError(
                f"gauge {self.name!r}: measures along {'xyz'[d - 1]}, but gravity = {snapshot.gravity.tolist()} does "
                f"not point down that axis: turn the case so that it does"
            )

    def blind(self, snapshot: Snapshot) -> str:
        """Inside a tank the line meets water or a floor; deeper than a spacing in a wall it meets none of its own."""
        d, l0 = snapshot.dimension, snapshot.spacing
        position = np.asarray(snapshot["position"], dtype=float)
        to_surface = np.asarray(snapshot["to_surface"], dtype=float)
        for rows, reach in ((snapshot.fluid, 1.5 * l0), (~snapshot.fluid & _looks_up(to_surface), l0)):
            aside = snapshot.shortest((position + to_surface)[rows, : d - 1] - np.asarray(self.at))
            if np.any(np.linalg.norm(aside, axis=1) < reach * (1.0 + 1e-6)):
                return ""
        return "has neither fluid nor a floor on its line"

    def measure(self, snapshot: Snapshot) -> dict[str, float]:
        snapshot = snapshot.seen_from(self.body)
        l0, d = snapshot.spacing, snapshot.dimension
        radius = _RADIUS * l0
        position = np.asarray(snapshot["position"], dtype=float)
        aside = snapshot.shortest(position[:, : d - 1] - np.asarray(self.at))
        near = np.flatnonzero(np.einsum("ij,ij->i", aside, aside) < radius**2)
        nothing = {c: float("nan") for c in self.columns(d)} | {"wetted_length": 0.0}
        if len(near) == 0:
            return nothing
        aside2 = np.einsum("ij,ij->i", aside[near], aside[near])
        height = position[near, -1]
        fluid = np.asarray(snapshot["kind"])[near] == FLUID
        to_surface = np.asarray(snapshot["to_surface"], dtype=float)[near]
        floor = ~fluid & _looks_up(to_surface)
        # The rim of a tank beside the line is no floor of its water.
        highest = height[floor].min(initial=np.inf) + 2.0 * radius
        floor &= height <= max(highest, height[fluid].max(initial=-np.inf))

        wet = fluid | floor
        if not np.any(wet):
            return nothing
        # From the lowest floor plane (or half a cell below the lowest water) upwards.
        low = height[floor].max(initial=-np.inf) if np.any(floor) else height[fluid].min() - l0
        low = min(low, height[fluid].min(initial=np.inf))
        z = np.arange(low, height[wet].max() + 2.0 * l0, l0 / _STEPS)
        cell = l0**d

        def fraction(rows: NDArray[np.bool_]) -> NDArray[np.float64]:
            total = np.zeros(len(z))
            r2 = aside2[rows, None] + (z[None, :] - height[rows, None]) ** 2
            total += cell * np.sum(_kernel(np.sqrt(r2), radius, d), axis=0)
            return total

        sides = np.minimum(fraction(~wet), 0.95)
        base = fraction(floor)
        everything = (base + fraction(fluid)) / (1.0 - sides)
        in_main = main_body(snapshot)[near] & fluid
        main = (base + fraction(in_main)) / (1.0 - sides)
        tops, length = _surfaces(z, everything, l0)
        main_tops, _ = _surfaces(z, main, l0)
        if len(tops) == 0:
            return nothing
        bed = z[0]
        if np.any(floor):
            directly = floor & (aside2 < l0**2)
            rows = directly if np.any(directly) else floor
            bed = float(np.max(height[rows] + to_surface[rows, -1]))
            length = max(length - (bed - z[0]), 0.0)
        return {
            "elevation": float(main_tops[-1] if len(main_tops) else tops[0]),
            "first_surface": float(tops[0]),
            "wetted_length": float(length),
        }


def _looks_up(to_surface: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which surfaces look up, by the vectors to them, shape (n, d): those of a floor or a rim."""
    return np.asarray(to_surface[:, -1] > 0.5 * np.linalg.norm(to_surface, axis=1))


def _kernel(r: NDArray[np.float64], radius: float, d: int) -> NDArray[np.float64]:
    """Return (1 - r^2/R^2)^3 over its integral over d-dimensional space [m^-d]."""
    norm = 4.0 / (np.pi * radius**2) if d == 2 else 315.0 / (64.0 * np.pi * radius**3)
    return norm * (1.0 - np.minimum(r / radius, 1.0) ** 2) ** 3


def _surfaces(z: NDArray[np.float64], chi: NDArray[np.float64], spacing: float) -> tuple[NDArray[np.float64], float]:
    """Return the heights at which the filled fraction falls to half of what it is below, and the filled length."""
    full = chi >= 0.5
    down = np.flatnonzero(full[:-1] & ~full[1:])
    up = np.flatnonzero(~full[:-1] & full[1:])

    def crossing(i: NDArray[np.intp]) -> NDArray[np.float64]:
        share = (chi[i] - 0.5) / (chi[i] - chi[i + 1])
        return z[i] + share * (z[i + 1] - z[i])

    bottoms = crossing(up)
    tops = np.array([_top(z, chi, int(i), top, spacing) for i, top in zip(down, crossing(down), strict=True)])
    start = z[0] if full[0] else 0.0
    length = float(np.sum(tops) - np.sum(bottoms) - start) if len(tops) else 0.0
    return tops, length


def _top(z: NDArray[np.float64], chi: NDArray[np.float64], i: int, top: float, spacing: float) -> float:
    """Return where the filled fraction, one half at ``top`` behind z[i], is half of that of the fluid below."""
    gaps = np.flatnonzero(chi[: i + 1] < 0.5)
    bed = z[gaps[-1]] + _BELOW[0] * spacing if len(gaps) else z[0]
    below = chi[: i + 1][
        (z[: i + 1] >= max(top - _BELOW[1] * spacing, bed)) & (z[: i + 1] <= top - _BELOW[0] * spacing)
    ]
    if len(below) == 0:
        return top
    level = 0.5 * min(max(float(np.mean(below)), 1.0 / _DENSEST), _DENSEST)
    while i > 0 and chi[i] < level:
        i -= 1
    while i + 2 < len(z) and chi[i + 1] >= level:
        i += 1
    return float(z[i] + (chi[i] - level) / (chi[i] - chi[i + 1]) * (z[i + 1] - z[i]))
