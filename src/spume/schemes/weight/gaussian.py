"""A truncated Gaussian weight function."""

from typing import ClassVar

from spume.schemes.weight.base import Weight


def gaussian(r, re):  # type: ignore[no-untyped-def]
    """W = exp(-(3 r/re)^2) - exp(-9)."""
    return 2.718281828459045 ** (-9.0 * r * r / (re * re)) - 1.2340980408667956e-4


class Gaussian(Weight, name="gaussian"):
    """W = exp(-(3 r/re)^2) - exp(-9): a Gaussian lowered to vanish at re."""

    ids: ClassVar = ("A2",)
    reference: ClassVar = "pan2008"
    formula: ClassVar = staticmethod(gaussian)
