"""A polynomial weight function of second degree."""

from typing import ClassVar

from spume.schemes.weight.base import Weight


def quadratic(r, re):  # type: ignore[no-untyped-def]
    """W = (1 - r/re)^2."""
    return (1.0 - r / re) ** 2


class Quadratic(Weight, name="quadratic"):
    """W = (1 - r/re)^2: smooth at re, so that a neighbour enters and leaves without a jump."""

    ids: ClassVar = ("A2",)
    reference: ClassVar = "pan2008"
    formula: ClassVar = staticmethod(quadratic)
