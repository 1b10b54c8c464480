"""Walls of one wall layer and dummy layers behind it."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from typing_extensions import override

from spume.bodies.rigid import Rigid
from spume.geometry import Grid, Tank, wall_layers
from spume.particles import DUMMY, WALL


class Wall(Rigid, name="wall"):
    """A wall, at rest or moving: one layer of wall particles that carry pressure, dummy layers behind it.

    A tank is wet inside, every other shape outside, unless `wetted` says otherwise. The shape's
    plane faces are moved to the nearest cell faces of the case's lattice (with a warning if that
    moves them visibly), so that the fluid beside a wall is one spacing from its first layer.

    To let a body stand on another one, make it reach `layers` spacings into it: where rows of two
    bodies coincide one is kept, and a wall row that no fluid can reach becomes a dummy. A body that moves
    or is taken away must instead stand beside the others, as a gate on a floor: what it leaves is whole.

    A plate with water on both sides must be as thick as the largest effective radius (three spacings for
    the default models), or the waters would see each other through it.
    """

    ids: ClassVar[tuple[str, ...]] = ("F1", "F2")
    reference: ClassVar[tuple[str, ...]] = ("koshizuka1996", "lee2011")

    wetted: Literal["inside", "outside"] | None = None
    """Side of the shape on which the fluid is; default: inside for a tank, outside for other shapes."""
    layers: Annotated[int, Field(ge=1, le=10)] = 3
    """Layers of particles, the wall layer included; at least the largest effective radius / spacing [1]."""
    slip: Literal["no-slip", "free-slip"] = "no-slip"
    """Velocity that viscosity sees in the wall: mirrored in full (no-slip, Lee 2011) or its normal part (free-slip).

    A wall function of the viscosity gives no-slip walls their stress; a free-slip wall has none.
    """
    velocity: tuple[float, ...] | None = None
    """Constant velocity [m/s] of rows that stay in place, as of a moving lid; default: at rest."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if isinstance(self.shape, Tank) and self.wetted == "outside":
            raise ValueError('a tank is wet inside; for the outside of a box use the shape "box"')
        if self.velocity is not None and self.motion is not None:
            raise ValueError("velocity is for rows that stay in place, motion moves them: give one of them")
        return self

    @property
    def wet_inside(self) -> bool:
        """Whether the fluid is inside the shape."""
        return isinstance(self.shape, Tank) if self.wetted is None else self.wetted == "inside"

    @override
    def rows(self, spacing: float, dimension: int, origin: tuple[float, ...] | None = None) -> dict[str, NDArray[Any]]:
        grid = Grid(origin or (0.0,) * dimension, spacing)
        shape, _ = self.shape.snapped(grid)
        layers = wall_layers(shape, grid, self.layers, wetted="inside" if self.wet_inside else "outside")
        velocity = np.zeros_like(layers.position)
        if self.velocity is not None:
            velocity[:] = self.velocity
        return {
            "position": layers.position,
            "kind": np.where(layers.wall, WALL, DUMMY).astype(np.int32),
            "to_surface": layers.to_surface,
            "exposed": layers.exposed,
            "velocity": velocity,
            "master": layers.master,
        }

    @override
    def expected_rows(self, spacing: float, dimension: int) -> float:
        return self.layers * self.shape.surface() / spacing ** (dimension - 1)

    @override
    def core(self, points: NDArray[np.float64], spacing: float, origin: tuple[float, ...]) -> NDArray[np.bool_]:
        if self.wet_inside:
            return super().core(points, spacing, origin)
        return self.shape.snapped(Grid(origin, spacing))[0].inside(points)
