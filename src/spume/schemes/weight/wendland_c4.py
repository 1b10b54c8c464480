"""Wendland's C4 polynomial."""

from typing import ClassVar

from spume.schemes.weight.base import Weight


def wendland_c4(r, re):  # type: ignore[no-untyped-def]
    """W = (1 - q)^6 (1 + 6 q + 35/3 q^2), q = r/re."""
    q = r / re
    return (1.0 - q) ** 6 * (1.0 + 6.0 * q + 35.0 / 3.0 * q * q)


def wendland_c4_slope(r, re):  # type: ignore[no-untyped-def]
    """dW/dr = -56/3 q (1 - q)^5 (1 + 5 q)/re, q = r/re."""
    q = r / re
    return -56.0 / 3.0 * q * (1.0 - q) ** 5 * (1.0 + 5.0 * q) / re


class WendlandC4(Weight, name="wendland-c4"):
    """W = (1 - q)^6 (1 + 6 q + 35/3 q^2) with q = r/re: positive definite and four times differentiable.

    Smoother than ``wendland`` and narrower, so it takes a larger re: prefer it where second derivatives are summed.
    """

    ids: ClassVar = ("A2",)
    reference: ClassVar = "wendland1995"
    formula: ClassVar = staticmethod(wendland_c4)
    slope: ClassVar = staticmethod(wendland_c4_slope)
