"""Harmonic motion."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from typing_extensions import override

from spume.motion.base import Motion


class Sinusoid(Motion, name="sinusoid"):
    """s = A q(t), theta = B q(t) with q = sin(2 pi t/T + phase), less its value at the start.

    With `ramp` the sine is multiplied by 10 x^3 - 15 x^4 + 6 x^5, x = t/ramp <= 1, which starts from rest
    without a jump of velocity or acceleration. A motion that begins at once with a velocity (phase 0, no
    ramp) is an impact.
    """

    amplitude: tuple[float, ...] | None = None
    """Amplitude of the displacement [m]; default: it does not translate."""
    amplitude_deg: float = 0.0
    """Amplitude of the angle [degrees]."""
    period: Annotated[float, Field(gt=0.0)] | None = None
    """Period T [s]; this or the frequency."""
    frequency: Annotated[float, Field(gt=0.0)] | None = None
    """Frequency 1/T [Hz]; this or the period."""
    phase_deg: float = 0.0
    """Phase [degrees]."""
    ramp: Annotated[float, Field(ge=0.0)] = 0.0
    """Time over which the amplitude grows from zero [s]."""

    @model_validator(mode="after")
    def _check(self) -> Self:
        if (self.period is None) == (self.frequency is None):
            raise ValueError("give the period or the frequency, one of them")
        if self.amplitude is None and self.amplitude_deg == 0.0:
            raise ValueError("nothing moves: give an amplitude or an amplitude_deg")
        return self

    @property
    @override
    def turns(self) -> bool:
        return self.amplitude_deg != 0.0

    @override
    def problems(self, dimension: int, end: float) -> Iterator[tuple[str, str]]:
        yield from super().problems(dimension, end)
        if self.ramp > 0.0 and self.phase_deg != 0.0:
            yield "phase_deg", "must be 0 with a ramp, which starts from the middle of the motion"

    @override
    def coordinates(self, t: float, order: int = 0) -> tuple[NDArray[np.float64], float]:
        omega = 2.0 * math.pi * (self.frequency or 1.0 / (self.period or math.inf))
        phase = omega * t + math.radians(self.phase_deg)
        sine = (math.sin(phase), omega * math.cos(phase), -(omega**2) * math.sin(phase))
        rise = _rise(t, self.ramp)
        q = (
            rise[0] * sine[0],
            rise[1] * sine[0] + rise[0] * sine[1],
            rise[2] * sine[0] + 2.0 * rise[1] * sine[1] + rise[0] * sine[2],
        )[order]
        return q * np.array(self.amplitude or (), dtype=float), q * math.radians(self.amplitude_deg)


def _rise(t: float, ramp: float) -> tuple[float, float, float]:
    """Return the ramp's factor and its first two derivatives."""
    if t >= ramp:
        return 1.0, 0.0, 0.0
    x = t / ramp
    value = x**3 * (10.0 + x * (6.0 * x - 15.0))
    return value, 30.0 * (x * (1.0 - x)) ** 2 / ramp, 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / ramp**2
