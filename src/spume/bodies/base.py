"""What is not fluid: a body with three verbs."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume.motion import Pose
from spume.named import Scheme


class Body(Scheme, family="body", selector="kind"):
    """Anything that touches the water and is not fluid.

    A body keeps its own state privately and writes its hydrodynamic image into its rows of the
    particle table. What it *is* is frozen; what it *does* lives in the arrays of `state`.
    """

    name: str
    """Label of the body, unique in the case."""

    def rows(self, spacing: float, dimension: int, origin: tuple[float, ...] | None = None) -> dict[str, NDArray[Any]]:
        """Return the initial rows on the lattice ``origin + (i + 1/2) spacing``.

        Args:
            spacing: l0 [m].
            dimension: 2 or 3.
            origin: a corner of a cell of the case's lattice [m]; default: the coordinate origin.

        Returns:
            ``position``, shape (n, d) [m]; ``kind`` (n,); ``to_surface`` (n, d) [m]; ``velocity`` (n, d)
            [m/s]; ``master`` (n,), for a dummy the index among these rows of the wall row that it
            copies, else its own.
        """
        raise NotImplementedError

    def expected_rows(self, spacing: float, dimension: int) -> float:
        """Return about how many rows the body will have, known without making them."""
        return 0.0

    def core(self, points: NDArray[np.float64], spacing: float, origin: tuple[float, ...]) -> NDArray[np.bool_]:
        """Return which points [m], shape (n, d), lie deep inside the body, where it needs no rows.

        No fluid may start there or where the body has rows. The lattice is that of `rows`.
        """
        return np.zeros(len(points), dtype=bool)

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the body's own state as named arrays of any shape, saved and restored by checkpoints."""
        return {}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Take back what `state` gave: the arrays that it returns, of the same shapes, are filled in place."""
        for name, values in self.state().items():
            values[...] = state[name]

    def pose(self, t: float, dimension: int) -> Pose | None:
        """Return where the body is at the time t [s] relative to the start, for what rides on it; None: at rest."""
        return None

    def prescribe(self, particles: Any, t: float, dt: float) -> None:
        """Set ``wall_velocity`` of the body's rows over the step (idempotent); insert or remove rows."""

    def move(self, particles: Any, t: float) -> None:
        """Put the body's rows where they are at the time t [s] (idempotent); the step says when in its course."""

    def force(self, particles: Any, pairs: Any, dt: float) -> None:
        """Add what acts on the fluid to ``particles.acceleration`` [m/s^2]."""

    def respond(self, particles: Any, t: float, dt: float) -> None:
        """Take the load of the fluid and advance the body's own state to t + dt."""

    def max_dt(self, t: float, spacing: float) -> float:
        """Return the largest time step [s] that the body can follow at a Courant number of one.

        Args:
            t: time at which the step begins [s].
            spacing: l0 [m].
        """
        return math.inf
