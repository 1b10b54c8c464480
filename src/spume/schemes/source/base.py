"""The family of right sides of the pressure Poisson equation."""

from typing import Any, ClassVar

from spume.lattice import Lattice
from spume.named import Scheme
from spume.pairs import Pairs
from spume.particles import Field, Particles

SOURCE = Field("source", (), "1/s^2", "right side of div(grad(P)/rho) = source")
DIVERGENCE = Field("divergence", (), "1/s", "divergence of the predicted velocity")


class Source(Scheme, family="source"):
    """A right side of div(grad(P)/rho) = source [1/s^2]; compression makes it negative."""

    needs: ClassVar[tuple[Field, ...]] = (SOURCE, DIVERGENCE)
    instant: ClassVar[str]
    """Positions at which it is evaluated: ``k`` (start of the step) or ``*`` (after the predictor moved)."""

    from_velocity: ClassVar[bool]
    """Whether it measures the motion of the fluid by velocities (not by the crowding of rows)."""

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
