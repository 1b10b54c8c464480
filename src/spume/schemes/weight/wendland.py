"""Wendland's C2 polynomial."""

from typing import ClassVar

from spume.schemes.weight.base import Weight


def wendland(r, re):  # type: ignore[no-untyped-def]
    """W = (1 - q)^4 (1 + 4 q), q = r/re."""
    q = r / re
    return (1.0 - q) ** 4 * (1.0 + 4.0 * q)


def wendland_slope(r, re):  # type: ignore[no-untyped-def]
    """dW/dr = -20 q (1 - q)^3/re, q = r/re."""
    q = r / re
    return -20.0 * q * (1.0 - q) ** 3 / re


class Wendland(Weight, name="wendland"):
    """W = (1 - q)^4 (1 + 4 q) with q = r/re: positive definite, resists pairing of particles."""

    ids: ClassVar = ("A2",)
    reference: ClassVar = "wendland1995"
    formula: ClassVar = staticmethod(wendland)
    slope: ClassVar = staticmethod(wendland_slope)
