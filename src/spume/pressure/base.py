"""The family of linear solvers."""

from dataclasses import dataclass
from typing import ClassVar

from pydantic import Field as Parameter

from spume import kernels
from spume.named import Scheme
from spume.particles import Field, Particles
from spume.pressure.matrix import LinearSystem

START_SHARE = 1e-4
"""Part of ||D x0|| (diagonal times first guess) that the right side is taken to have at least.

Where the flow has no divergence the right side is rounding error; a residual relative to that alone could
never be reached from a pressure that is not small.
"""

LOOSEST = 1e-3
"""Relative residual that a row is solved to however little it matters to the volume: slow flows are solved as well."""


@kernels.func
def square_of_row(right, pull, floor, loosest):  # type: ignore[no-untyped-def]
    """Return a row's part of the square that the residual is relative to; ``pull`` is its diagonal times first guess.

    ``floor`` and ``loosest`` are those of `conjugate_gradient.negligible`.
    """
    own = right * right + START_SHARE**2 * pull * pull
    return own + min(floor, loosest * own)


@dataclass(frozen=True)
class Solution:
    """How a solve went.

    Attributes:
        iterations: number of iterations.
        residual: ||b - A x|| / (sum_i s_i + min((e/tolerance)^2, (LOOSEST/tolerance)^2 s_i))^(1/2) with
            s_i = b_i^2 + (START_SHARE d_i x0_i)^2 and e what the system neglects (``LinearSystem.negligible``).
        fallbacks: 1 if another method had to finish the solve.
    """

    iterations: int
    residual: float
    fallbacks: int = 0


class NotConverged(RuntimeError):
    """The iteration did not reach its tolerance; the message says how far it came."""


class Solver(Scheme, family="solver"):
    """Solves a linear system, starting from what its ``solution`` holds."""

    symmetric_only: ClassVar[bool]
    """Whether the method needs a symmetric matrix."""
    needs: ClassVar[tuple[Field, ...]] = ()

    tolerance: float = Parameter(default=1e-5, gt=0.0, lt=1.0)
    """Relative residual at which the iteration stops (see ``Solution``) [1]."""
    volume_error: float = Parameter(default=1e-6, ge=0.0, lt=1.0)
    """Relative change of volume in a step, root mean square, that the pressure may leave; 0: ``tolerance`` decides [1].

    The residual r of the pressure equation is a rate of change of the divergence, and dt^2 r the part of a particle's
    volume by which it changes in the step against the source. The iteration stops when the residual is small against
    the right side or against volume_error/dt^2, whichever comes first, but no row counts as solved for the latter that
    is not solved to a thousandth.
    """
    largest_iterations: int = Parameter(default=10_000, ge=1)
    """Iterations after which it gives up [1]."""

    def __call__(self, system: LinearSystem, particles: Particles) -> Solution:
        """Solve for the unknown rows of ``system.solution``.

        Raises:
            NotConverged: the tolerance was not reached.
        """
        raise NotImplementedError
