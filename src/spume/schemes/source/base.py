"""The family of right sides of the pressure Poisson equation."""

from typing import Any, ClassVar

from pydantic import Field as Parameter

from spume import kernels
from spume.lattice import Lattice
from spume.named import Scheme
from spume.pairs import Pairs
from spume.particles import Field, Particles

SOURCE = Field("source", (), "1/s^2", "right side of div(grad(P)/rho) = source")
DIVERGENCE = Field("divergence", (), "1/s", "divergence of the predicted velocity")

NUMBER_DENSITY_START = Field(
    "number_density_start", (), "1", "particle number density at the start of the step", restart=True
)
NUMBER_DENSITY_RATE = Field(
    "number_density_rate", (), "1/s", "rate of change of n at the start of the step", restart=True
)


@kernels.func
def volume_error(n, n0, surface_share):  # type: ignore[no-untyped-def]
    """Return (n - n0)/n0; near the free surface n < n0 says that neighbours are missing, not that the fluid is thin."""
    error = (n - n0) / n0
    if error < 0.0:
        error *= 1.0 - surface_share
    return error


class Source(Scheme, family="source"):
    """A right side of div(grad(P)/rho) = source [1/s^2]; compression makes it negative."""

    needs: ClassVar[tuple[Field, ...]] = (SOURCE, DIVERGENCE)
    instant: ClassVar[str]
    """Positions at which it is evaluated: ``k`` (start of the step) or ``*`` (after the predictor moved)."""
    history: ClassVar[tuple[str, ...]] = ()
    """Earlier instants that it reads besides: ``k-1`` and ``k``; ``remember`` takes them down."""

    from_velocity: ClassVar[bool]
    """Whether it measures the motion of the fluid by velocities (not by the crowding of rows)."""
    of_volume: ClassVar[bool] = False
    """Whether it states the volume itself, so that compression follows P; else its rate: compression follows dP/dt."""

    of_slope: ClassVar[bool] = False
    """Whether it sums the derivative of the weight, whose size only the higher-order Laplacian shares."""

    compressibility: float = Parameter(default=0.0, ge=0.0)
    """Relative compressibility alpha_c = 1/(rho c^2), 4.5e-10 for water; 0 is incompressible [1/Pa].

    The equation becomes div(grad(P)/rho) - alpha_c (P - P_0)/dt^2 = source, with P_0 = 0 for a source that states the
    volume (Ikeda et al. 2001) and P_0 = P^k for one that states its rate (Khayyer & Gotoh 2016). It adds to the
    diagonal, so the solver needs fewer iterations and a closed tank has a definite pressure.
    """

    def cited(self) -> tuple[str, ...]:
        """Return the keys of its publications, with that of the compressibility where there is one."""
        more = ("ikeda2001" if self.of_volume else "khayyer2016",) if self.compressibility > 0.0 else ()
        return (*self.publications(), *more)

    def remember(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any, mirror: bool) -> None:
        """Take down what it reads of the start of the step (see ``history``); the arguments as below."""

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs, dt: float,
        divergence: Any, number_density: Any, mirror: bool,
    ) -> None:  # fmt: skip
        """Write ``source`` of fluid and wall rows.

        Args:
            dt: time step [s].
            divergence: a ``Divergence`` scheme.
            number_density: the ``NumberDensity`` scheme that wrote ``number_density``.
            mirror: see ``Divergence``.
        """
        raise NotImplementedError
