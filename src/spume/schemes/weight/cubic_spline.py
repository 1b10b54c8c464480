"""The cubic B-spline of smoothed particle hydrodynamics."""

from typing import ClassVar

from spume.schemes.weight.base import Weight


def cubic_spline(r, re):  # type: ignore[no-untyped-def]
    """W = B-spline of q = 2 r/re, support q < 2."""
    q = 2.0 * r / re
    inner = 1.0 - 1.5 * q * q + 0.75 * q * q * q
    outer = 0.25 * (2.0 - q) ** 3
    return (q < 1.0) * inner + (q >= 1.0) * outer


def cubic_spline_slope(r, re):  # type: ignore[no-untyped-def]
    """dW/dr of the B-spline, q = 2 r/re."""
    q = 2.0 * r / re
    inner = 2.25 * q * q - 3.0 * q
    outer = -0.75 * (2.0 - q) ** 2
    return ((q < 1.0) * inner + (q >= 1.0) * outer) * 2.0 / re


class CubicSpline(Weight, name="cubic-spline"):
    """W = 1 - 3/2 q^2 + 3/4 q^3 for q = 2 r/re < 1, (2 - q)^3/4 above: smooth, bounded at r = 0."""

    ids: ClassVar = ("A2",)
    reference: ClassVar = "monaghan1994"
    formula: ClassVar = staticmethod(cubic_spline)
    slope: ClassVar = staticmethod(cubic_spline_slope)
