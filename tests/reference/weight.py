"""Weight functions W(r, re), 0 < r < re."""

from math import exp


def inverse(r, re):
    return re / r - 1


def inverse_bounded(r, re):
    return re / (0.85 * r + 0.15 * re) - 1


def inverse_square(r, re):
    return re**2 / r**2 - 1


def quadratic(r, re):
    return 1 - 2 * r / re + r**2 / re**2


def isochoric(r, re):
    q = r / re
    powers = (1.0, -5.436, 16.395, -20.917, 9.501)
    return sum(c * q**k for k, c in enumerate(powers)) * (1 - 2 * q + q**2)


def gaussian(r, re):
    return exp(-9 * r**2 / re**2) - exp(-9)


def wendland(r, re):
    q = r / re
    return 1 - 10 * q**2 + 20 * q**3 - 15 * q**4 + 4 * q**5


def cubic_spline(r, re):
    """With the smoothing length h = re/2 and W(0) = 1."""
    q = r / (re / 2)
    return 1 - 3 / 2 * q**2 + 3 / 4 * q**3 if q < 1 else (2 - q) ** 3 / 4
