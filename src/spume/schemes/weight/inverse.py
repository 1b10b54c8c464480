"""The weight function of the original method."""

from typing import ClassVar

from spume.schemes.weight.base import Weight


def inverse(r, re):  # type: ignore[no-untyped-def]
    """W = re/r - 1."""
    return re / r - 1.0


def inverse_slope(r, re):  # type: ignore[no-untyped-def]
    """dW/dr = -re/r^2."""
    return -re / (r * r)


class Inverse(Weight, name="inverse"):
    """W = re/r - 1 (Koshizuka & Oka 1996).

    Singular at r = 0: close pairs count strongly, which keeps particles apart. The usual choice.
    """

    ids: ClassVar = ("A2",)
    reference: ClassVar = "koshizuka1996"
    formula: ClassVar = staticmethod(inverse)
    slope: ClassVar = staticmethod(inverse_slope)
