"""Walls of the original method: wall rows in the matrix, dummies that only count."""

from typing import ClassVar

from spume.particles import FLUID, WALL
from spume.wall_models.base import WallModel


class Resting(WallModel, name="resting"):
    """One layer of wall rows with an equation, dummies behind it that only add to n (Koshizuka & Oka 1996).

    Walls rest in the source and the matrix takes the homogeneous condition dP/dn = 0: the flux through the
    wall is counted once, in the source.
    """

    ids: ClassVar = ("F1",)
    reference: ClassVar = "koshizuka1996"
    carriers: ClassVar = FLUID | WALL
