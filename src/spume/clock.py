"""Simulated time and the limits of the time step."""

from dataclasses import dataclass, field
from math import ceil, inf, sqrt

from spume.lattice import Lattice


@dataclass
class Clock:
    """Chooses the time step.

    Limits: courant l0/|u_j - u_i|, with the largest relative speed of neighbours (less in spray, see
    `schemes.relative_motion`), for what changes the arrangement of the particles is how they move against each other;
    travel l0/|u|, with the largest speed of fluid and walls;
    courant sqrt(l0/|a|), so that a fluid at rest has one; viscosity; bodies; ``step_max``. The step grows by at
    most 20 % from one to the next, for sources with 1/dt^2 answer a jump of dt with a pressure spike.

    Attributes:
        end: time at which the run ends [s].
        courant: Courant number of the relative motion [1].
        travel: largest way of a particle in a step, as a multiple of l0 [1].
        step_max: largest step [s].
        time: simulated time [s].
        step: steps done.
        dt: the last step [s], 0 before the first.
        limiter: what limited the last step.
    """

    end: float
    courant: float = 0.2
    travel: float = 0.5
    step_max: float = inf
    time: float = 0.0
    step: int = 0
    dt: float = 0.0
    limiter: str = ""
    growth: float = field(default=1.2, repr=False)
    """Largest ratio of a step to the one before [1]."""

    @property
    def shorter(self) -> str:
        """How to make the steps shorter, for messages."""
        return f"lower time.courant and time.travel (now {self.courant:g} and {self.travel:g})"

    @property
    def done(self) -> bool:
        """Whether the end is reached (to rounding)."""
        return self.time >= self.end * (1.0 - 1e-12)

    def next_dt(
        self,
        lattice: Lattice,
        speed: float,
        relative: float,
        acceleration: float,
        viscous: float = inf,
        bodies: float = inf,
        sound: float = inf,
    ) -> float:
        """Return the next time step [s].

        Args:
            speed: largest speed [m/s].
            relative: largest relative speed of neighbours, as far as they are surrounded [m/s].
            acceleration: largest acceleration [m/s^2].
            viscous: limit of the viscosity [s].
            bodies: limit of the bodies [s].
            sound: limit of the speed of sound [s].
        """
        limits = {
            "courant": self.courant * lattice.spacing / relative if relative > 0 else inf,
            "travel": self.travel * lattice.spacing / speed if speed > 0 else inf,
            "acceleration": self.courant * sqrt(lattice.spacing / acceleration) if acceleration > 0 else inf,
            "viscosity": viscous,
            "bodies": bodies,
            "sound": sound,
            "step_max": self.step_max,
        }
        if self.dt > 0:
            limits["growth"] = self.growth * self.dt
        self.limiter, dt = min(limits.items(), key=lambda item: item[1])
        remaining = self.end - self.time
        if dt == inf:
            return remaining
        # A last step trimmed to a sliver would be a jump of dt as well: spread the remainder evenly.
        return remaining / ceil(remaining / dt - 1e-9) if remaining < 50 * dt else dt

    def eased(self, dt: float, coming: float) -> float:
        """Return a time step [s] that does not jump over what is about to happen.

        Args:
            dt: of `next_dt`, which knows of the time at which the step begins alone.
            coming: what bodies and prescribed accelerations allow at the instants of that step, at a Courant number of
                one [s]. They may exceed it by as much as a step may grow.
        """
        allowed = self.growth * self.courant * coming
        if allowed < dt:
            self.limiter, dt = "coming motion", allowed
        return dt

    def advance(self, dt: float) -> None:
        """Count a step of length dt [s]."""
        self.dt = dt
        self.time += dt
        self.step += 1
