"""A polynomial weight function of second degree."""

from typing import ClassVar

from spume.schemes.weight.base import Weight


def quadratic(r, re):  # type: ignore[no-untyped-def]
    """W = (1 - r/re)^2."""
    return (1.0 - r / re) ** 2


def quadratic_slope(r, re):  # type: ignore[no-untyped-def]
    """dW/dr = -2 (1 - r/re)/re."""
    return -2.0 * (1.0 - r / re) / re


class Quadratic(Weight, name="quadratic"):
    """W = (1 - r/re)^2: smooth at re, so that a neighbour enters and leaves without a jump."""

    ids: ClassVar = ("A2",)
    reference: ClassVar = "pan2008"
    formula: ClassVar = staticmethod(quadratic)
    slope: ClassVar = staticmethod(quadratic_slope)
