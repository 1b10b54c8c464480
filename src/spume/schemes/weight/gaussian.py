"""A truncated Gaussian weight function."""

from typing import ClassVar

from spume.schemes.weight.base import Weight


def gaussian(r, re):  # type: ignore[no-untyped-def]
    """W = exp(-(3 r/re)^2) - exp(-9)."""
    return 2.718281828459045 ** (-9.0 * r * r / (re * re)) - 1.2340980408667956e-4


def gaussian_slope(r, re):  # type: ignore[no-untyped-def]
    """dW/dr = -18 r/re^2 exp(-(3 r/re)^2)."""
    return -18.0 * r / (re * re) * 2.718281828459045 ** (-9.0 * r * r / (re * re))


class Gaussian(Weight, name="gaussian"):
    """W = exp(-(3 r/re)^2) - exp(-9): a Gaussian lowered to vanish at re."""

    ids: ClassVar = ("A2",)
    reference: ClassVar = "pan2008"
    formula: ClassVar = staticmethod(gaussian)
    slope: ClassVar = staticmethod(gaussian_slope)
