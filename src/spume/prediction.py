"""What a run will take: particles, steps, memory, time."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume import kernels
from spume.case import Case
from spume.moving import speeds
from spume.particles import FLUID

# Measured by ``spume bench dam-break --threads 1`` and ``spume bench dam-break-3d --threads 1``, then ``--threads 2``.
# Memory: spacings 1.34e-3 and 4.243e-4 in 2D; 6e-3, 3e-3 and 2.38e-3 in 3D, where a row takes 0.86 kB and one near the
# water 1.03 kB more, which is 1.7 kB where 80 % of the rows are near it (1.9 where all are).

BYTES_PER_ROW = {2: 1400, 3: 1700}
"""Memory of a run per row of the table [bytes]."""

_BYTES_ON_HOST = 400
"""Memory that a row takes of the machine itself where another device computes: the initial rows [bytes]."""

_BASE_BYTES = 350 << 20  # of the program itself
_MICROSECONDS = {2: 5.2, 3: 7.5}  # of one thread per fluid particle and step
_PARALLEL = 0.82  # part of a step that threads share: two are 1.7 times as fast as one in 3D
_ON_CARD = (1.3e-8, 12e-3)  # s per fluid particle, and per step, of an H100 in double precision and 3D (2026-11-26)
_START_ON_CARD = 30.0  # s
_START = 10.0  # s, until kernels are compiled
_PER_STEP = 1e-3  # s, whatever the number of particles


def memory() -> int:
    """Return this machine's memory [bytes]; where it cannot be asked, 8 GiB."""
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return 8 << 30


def host_bytes_per_row(case: Case) -> int:
    """Return the memory [bytes] of the machine that a case takes per row, whatever its device has of its own."""
    return BYTES_PER_ROW[case.dimension] if device_of(case) == "cpu" else _BYTES_ON_HOST


def device_of(case: Case) -> str:
    """Return the device that a case is computed on: its own, that of SPUME_DEVICE, else ``cpu``."""
    return case.device or kernels.default_device()


def fall_speed(case: Case, position: NDArray[np.float64]) -> float:
    """Return the speed [m/s] of a fall over the height of the fluid's rows at `position` [m], shape (n, d)."""
    assert case.domain.gravity is not None
    g = float(np.linalg.norm(case.domain.gravity.at(0.0)))
    return math.sqrt(2.0 * g * float(np.ptp(position[:, -1]) + case.spacing))


@dataclass(frozen=True)
class Prediction:
    """What a run will take, roughly.

    Attributes:
        fluid, rows: particles.
        steps: time steps.
        bytes: memory.
        seconds: wall time.
    """

    fluid: int
    rows: int
    steps: int
    bytes: int
    seconds: float


def predict(case: Case, rows: Mapping[str, NDArray[Any]], threads: int) -> Prediction:
    """Return an estimate of steps, memory and time on `threads` processor threads, or on a card of 2026.

    The speed is taken as that of a fall over the fluid's height, at least that of the initial field and, at each
    instant, of prescribed motions; the cost as microseconds per fluid particle and step, of which threads share a part
    (Amdahl's law). The rows are those of `spume.build.initial_rows`: names to arrays of shape (n, …).
    """
    assert case.domain.gravity is not None
    fluid = rows["kind"] == FLUID
    position = rows["position"][fluid]
    speed = max(
        fall_speed(case, position),
        float(np.linalg.norm(rows["velocity"], axis=1).max(initial=0.0)),
        math.sqrt(case.domain.gravity.stiffness) * float(np.ptp(position, axis=0).max()),
        1e-6,
    )
    viscosity = max(entry.viscosity for entry in case.fluid)
    longest = 0.1 * case.spacing**2 / viscosity if viscosity > 0.0 else math.inf
    longest = min(longest, case.time.step_max or math.inf, case.time.end)
    fastest = np.array([speed])
    for moved in speeds(case).values():
        fastest = np.maximum(fastest, moved)
    dt = np.minimum(case.time.travel * case.spacing / fastest, longest)
    steps = math.ceil(float(np.mean(case.time.end / dt)) * (1.0 - 1e-12))
    count = int(fluid.sum())
    cost = _MICROSECONDS[case.dimension] * (1.0 - _PARALLEL + _PARALLEL / threads)
    seconds = _START + steps * (count * cost * 1e-6 + _PER_STEP)
    if device_of(case) != "cpu":
        seconds = _START_ON_CARD + steps * (count * _ON_CARD[0] + _ON_CARD[1])
    total = len(fluid)
    size = total * BYTES_PER_ROW[case.dimension] + _BASE_BYTES
    return Prediction(count, total, steps, size, seconds)
