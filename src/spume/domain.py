"""What a step advances: the table of rows with its pairs, bodies and linear system."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Any

from spume.frame import BodyForce, body_force
from spume.lattice import Lattice
from spume.motion import Motion
from spume.pairs import Pairs
from spume.particles import Particles
from spume.pressure.components import Components
from spume.pressure.matrix import LinearSystem
from spume.stopwatch import Stopwatch
from spume.voids import Voids


@dataclass
class Domain:
    """One body of water with one spacing.

    Attributes:
        lattice: reference arrangement.
        particles: the table of rows.
        pairs: neighbours of the rows.
        bodies: what is not fluid.
        gravity: a ``Gravity`` scheme.
        system: the linear system of the pressure.
        components: connected components of that system.
        voids: what is enclosed between the rows, followed from step to step.
        stages: wall time of the stages of the step.
        motion: motion of the coordinate system, as that of a tank; None: the laboratory's.
    """

    lattice: Lattice
    particles: Particles
    pairs: Pairs
    bodies: Sequence[Any]
    gravity: Any
    system: LinearSystem = field(default_factory=lambda: LinearSystem(single=True))
    components: Components = field(default_factory=Components)
    voids: Voids = field(default_factory=Voids)
    stages: Stopwatch = field(default_factory=Stopwatch)
    motion: Motion | None = None

    @property
    def prescribed(self) -> bool:
        """Whether anything changes with time that does not depend on the flow: gravity, the frame, a body's motion."""
        d = self.lattice.dimension
        moving = self.motion is not None or any(body.pose(0.0, d) is not None for body in self.bodies)
        return moving or not self.gravity.steady

    def max_dt(self, t: float) -> float:
        """Return the largest time step [s] that bodies can follow at a Courant number of one, at the time t [s]."""
        return min((body.max_dt(t, self.lattice.spacing) for body in self.bodies), default=inf)

    def force(self, t: float) -> BodyForce:
        """Return gravity and fictitious accelerations at the time t [s]."""
        return body_force(self.gravity, self.motion, t)
