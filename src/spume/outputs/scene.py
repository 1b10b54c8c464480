"""Paints a frame in 3D: balls of water before the far walls of what holds it, and bodies that stand in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from spume.outputs import raster
from spume.outputs.faces import Faces, faces_of
from spume.outputs.snapshot import FLUID
from spume.outputs.vtkhdf import Frame

if TYPE_CHECKING:
    from spume.outputs.pictures import View

_WALL_COLOUR = np.array([1.0, 1.0, 1.0], dtype=np.float32)
_OBSTACLE_COLOUR = np.array([0.80, 0.52, 0.36], dtype=np.float32)
_LIGHT = np.array([-0.5, 0.55, 0.67])  # right, up, towards the eye
_PIXELS = 2.5  # between the points of a tile
_BALL = 0.6  # radius of a particle [l0]


def paint(frame: Frame, view: View, shape: tuple[int, int], colours: raster.Colours) -> raster.Image:
    """Return the picture of a frame, RGB, of this height and width [pixels].

    Args:
        frame: the frame.
        view: what is shown.
        shape: height and width [pixels].
        colours: of the rows, shape (rows, 3).
    """
    camera = raster.Camera(view.lower, view.upper, *view.settings.view_deg, shape)
    fluid = np.asarray(frame["kind"]) == FLUID
    water = np.asarray(frame["position"], dtype=float)[fluid]
    tiles = faces_of(frame)
    pieces = int(np.clip(np.ceil(frame.spacing * camera.scale / _PIXELS), 1, 16))
    points, owner = tiles.points(seen(tiles, camera), pieces)
    # Half the diagonal of a piece, which is longer where a tile is slanted.
    longest = np.linalg.norm(tiles.first, axis=1) + np.linalg.norm(tiles.second, axis=1)
    radius = np.concatenate([np.full(len(water), _BALL * frame.spacing), 0.36 * longest[owner] / pieces])
    behind = np.concatenate([np.zeros(len(water)), np.where(tiles.obstacle[owner], 0.0, frame.spacing)])
    ball = np.arange(len(radius)) < len(water)
    return raster.paint_spheres(
        camera,
        np.concatenate([water, points]),
        radius,
        np.concatenate([colours[fluid], _shades(tiles, camera)[owner]]),
        ball,
        behind,  # particles that touch floor and walls are whole
    )


def seen(tiles: Faces, camera: raster.Camera) -> NDArray[np.bool_]:
    """Return which tiles look at the eye: floor and far sides of a tank, not its front, and bodies; shape (tiles,)."""
    room = ~tiles.obstacle & ~tiles.outer
    shown: NDArray[np.bool_] = ~tiles.outer & (np.einsum("ij,ij->i", camera.eye - tiles.centre, tiles.normal) > 0.0)
    if room.any():  # a foundation under the floor is not to be seen
        lower, upper = tiles.centre[room].min(axis=0), tiles.centre[room].max(axis=0)
        upper[2] = np.inf
        margin = 1e-3 * tiles.spacing
        shown &= np.all((tiles.centre > lower - margin) & (tiles.centre < upper + margin), axis=1)
    return shown


def _shades(tiles: Faces, camera: raster.Camera) -> raster.Colours:
    normal = tiles.normal
    room = (0.90 + 0.06 * normal[:, 2] - 0.05 * np.abs(normal[:, 0]))[:, None] * _WALL_COLOUR
    shade = 0.62 + 0.38 * np.clip(normal @ (camera.axes.T @ _LIGHT), 0.0, 1.0)
    made: NDArray[np.float32] = np.where(tiles.obstacle[:, None], _OBSTACLE_COLOUR * shade[:, None], room)
    return made.astype(np.float32)
