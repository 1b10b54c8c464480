"""Named initial fields of a fluid."""

from spume.initial.base import Initial, Rest
from spume.initial.fields import (
    Hydrostatic,
    Rotation,
    StandingWave,
    Strain,
    TaylorGreen,
    Uniform,
)
from spume.initial.table import Table

__all__ = [
    "Hydrostatic",
    "Initial",
    "Rest",
    "Rotation",
    "StandingWave",
    "Strain",
    "Table",
    "TaylorGreen",
    "Uniform",
]
