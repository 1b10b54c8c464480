"""A weight function that falls off with the square of the distance."""

from typing import ClassVar

from spume.schemes.weight.base import Weight


def inverse_square(r, re):  # type: ignore[no-untyped-def]
    """W = (re/r)^2 - 1."""
    return (re / r) ** 2 - 1.0


def inverse_square_slope(r, re):  # type: ignore[no-untyped-def]
    """dW/dr = -2 re^2/r^3."""
    return -2.0 * re * re / r**3


class InverseSquare(Weight, name="inverse-square"):
    """W = (re/r)^2 - 1: steeper than the original one, near neighbours dominate."""

    ids: ClassVar = ("A2",)
    reference: ClassVar = "pan2008"
    formula: ClassVar = staticmethod(inverse_square)
    slope: ClassVar = staticmethod(inverse_square_slope)
