"""A weight function without the singularity of the original one."""

from typing import ClassVar

from spume.schemes.weight.base import Weight


def inverse_bounded(r, re):  # type: ignore[no-untyped-def]
    """W = re/(0.85 r + 0.15 re) - 1."""
    return re / (0.85 * r + 0.15 * re) - 1.0


def inverse_bounded_slope(r, re):  # type: ignore[no-untyped-def]
    """dW/dr = -0.85 re/(0.85 r + 0.15 re)^2."""
    return -0.85 * re / (0.85 * r + 0.15 * re) ** 2


class InverseBounded(Weight, name="inverse-bounded"):
    """W = re/(0.85 r + 0.15 re) - 1 (Zhang & Wan), finite at r = 0.

    Prefer it where particles come very close, as in impacts: no force peaks.
    """

    ids: ClassVar = ("A2",)
    reference: ClassVar = "zhang2014"
    formula: ClassVar = staticmethod(inverse_bounded)
    slope: ClassVar = staticmethod(inverse_bounded_slope)
