"""No wall function."""

from typing import ClassVar

from spume.schemes.wall_function.base import WallFunction


class Resolved(WallFunction, name="none"):
    """The velocity falls to the wall's over the rows beside it, as images of the fluid in the wall make it.

    Right where the particles resolve the boundary layer: slow or viscous flows, y+ of the first row of the order of 1.
    Elsewhere the wall is almost frictionless: the molecular viscosity times a velocity that falls over half a spacing.
    """

    resolved: ClassVar = True
