"""Initial fields given by a formula."""

from __future__ import annotations

import math
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from typing_extensions import override

from spume.initial.base import Initial, Points, Setting

Positive = Annotated[float, Field(gt=0)]


class Uniform(Initial, name="uniform"):
    """The same velocity everywhere."""

    value: tuple[float, ...]
    """Velocity [m/s]."""

    @override
    def velocity(self, points: Points, setting: Setting) -> Points:
        return np.broadcast_to(np.array(self.value, dtype=float), points.shape).copy()


class Rotation(Initial, name="rotation"):
    """Rigid rotation u = omega x (r - centre); in 3D about the z axis."""

    rate: float
    """Angular velocity omega [rad/s], counter-clockwise in the x-y plane."""
    centre: tuple[float, ...] | None = None
    """Point on the axis [m]; default: the coordinate origin."""

    @override
    def velocity(self, points: Points, setting: Setting) -> Points:
        r = points - (0.0 if self.centre is None else np.array(self.centre))
        u = np.zeros_like(points)
        u[:, 0], u[:, 1] = -self.rate * r[:, 1], self.rate * r[:, 0]
        return u


class Strain(Initial, name="strain"):
    """Plane strain u = (-A x, A y), the start of the elliptical drop of Monaghan (1994)."""

    reference: ClassVar[str] = "monaghan1994"

    rate: float
    """Rate of strain A [1/s]: the fluid contracts in x and stretches in y where it is positive."""
    centre: tuple[float, ...] | None = None
    """Point at rest [m]; default: the coordinate origin."""

    @override
    def velocity(self, points: Points, setting: Setting) -> Points:
        r = points - (0.0 if self.centre is None else np.array(self.centre))
        u = np.zeros_like(points)
        u[:, 0], u[:, 1] = -self.rate * r[:, 0], self.rate * r[:, 1]
        return u


class TaylorGreen(Initial, name="taylor-green"):
    """Taylor-Green vortices, the periodic solution of the Navier-Stokes equations in the x-y plane.

    u = -U cos(k x) sin(k y), v = U sin(k x) cos(k y), p = -rho U^2 (cos 2kx + cos 2ky) / 4 with
    k = 2 pi / wavelength; the velocity decays as exp(-2 nu k^2 t).
    """

    dimensions: ClassVar[tuple[int, ...]] = (2,)
    reference: ClassVar[str] = "taylor1937"

    speed: Positive = 1.0
    """Largest velocity U [m/s]."""
    wavelength: Positive = 1.0
    """Wavelength [m]; the domain's sides must be multiples of it."""

    @override
    def velocity(self, points: Points, setting: Setting) -> Points:
        x, y = (2.0 * math.pi / self.wavelength * points).T
        return self.speed * np.stack([-np.cos(x) * np.sin(y), np.sin(x) * np.cos(y)], axis=1)

    @override
    def pressure(self, points: Points, setting: Setting) -> NDArray[np.float64]:
        x, y = (2.0 * math.pi / self.wavelength * points).T
        scale = -setting.density * self.speed**2 / 4.0
        return np.asarray(scale * (np.cos(2.0 * x) + np.cos(2.0 * y)))


class StandingWave(Initial, name="standing-wave"):
    """A standing gravity wave at rest at its highest: eta = amplitude cos(k (x - crest)).

    The shape holds the fluid at rest, a rectangle of the still depth whose length is a multiple of
    half the wavelength (or periodic) and that starts at a crest or a trough. Its cells are moved so
    that the top becomes eta and every cell keeps its area: columns are shifted sideways until each
    holds as much as before, x + a sin(k x) / (k h) = x at rest, then stretched by 1 + eta / h.
    """

    amplitude: Positive
    """Amplitude a of the surface elevation [m]."""
    wavelength: Positive
    """Wavelength [m]."""
    crest: float = 0.0
    """Where a crest is along x [m]."""

    @override
    def displaced(self, points: Points, setting: Setting) -> Points:
        k = 2.0 * math.pi / self.wavelength
        bottom = setting.lower[-1]
        depth = setting.upper[-1] - bottom
        ratio = self.amplitude / depth
        if ratio >= 1.0:
            raise ValueError(f"amplitude = {self.amplitude:g} must be less than the depth of {depth:g} m")
        at_rest = k * (points[:, 0] - self.crest)
        phase = at_rest.copy()
        for _ in range(60):  # Newton's method; the slope is at least 1 - a/h > 0
            phase -= (phase + ratio * np.sin(phase) - at_rest) / (1.0 + ratio * np.cos(phase))
        moved = points.copy()
        moved[:, 0] = self.crest + phase / k
        moved[:, -1] = bottom + (points[:, -1] - bottom) * (1.0 + ratio * np.cos(phase))
        return moved


class Hydrostatic(Initial, name="hydrostatic"):
    """The pressure of the fluid at rest, rho |g| times the depth below its surface; zero above.

    Other fluids that stand on it, with no gap between, weigh on it with their own density, whatever
    their own initial fields are.
    """

    surface: float | None = None
    """Height of the free surface [m], measured against gravity, from which alone the pressure follows then;
    default: the top of the shape, and above it what other fluids stand there."""

    @override
    def pressure(self, points: Points, setting: Setting) -> NDArray[np.float64]:
        g = float(np.linalg.norm(setting.gravity))
        if g == 0.0:
            return np.zeros(len(points))
        up = -setting.gravity / g
        corner = np.where(up > 0.0, setting.upper, setting.lower)
        surface = float(corner @ up) if self.surface is None else self.surface
        own = setting.density * g * np.maximum(0.0, surface - points @ up)
        return np.asarray(own + setting.above if self.surface is None else own)
