"""A simulation: a domain, a step and a clock."""

from collections.abc import Callable
from math import inf
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume import kernels
from spume.clock import Clock
from spume.domain import Domain
from spume.outputs.snapshot import Snapshot
from spume.particles import ANY, FLUID
from spume.pressure.base import NotConverged
from spume.steps.base import Step, stage_times


class Diverged(RuntimeError):
    """The state is no longer a flow; the message says when, where, why and what helps."""


class Simulation:
    """Advances a domain in time.

    Args:
        domain: what is advanced.
        step: how.
        clock: how fast, and until when.

    Attributes:
        statistics: figures of the last step: dt, iterations, residual, removed rows, uses of limiters.
    """

    def __init__(self, domain: Domain, step: Step, clock: Clock) -> None:
        self.domain = domain
        self.step = step
        self.clock = clock
        self.statistics: dict[str, float] = {}
        domain.particles.declare(step.needed_fields())
        self._viscosity = float(np.max(domain.particles.numpy("kinematic_viscosity"), initial=0.0))
        self._acceleration = 0.0
        self._snapshot: Snapshot | None = None
        stage_times.clear()

    @property
    def particles(self) -> Any:
        """The table of rows."""
        return self.domain.particles

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.clock.time

    @property
    def dt(self) -> float:
        """The last time step [s]."""
        return self.clock.dt

    @property
    def step_index(self) -> int:
        """Steps done."""
        return self.clock.step

    @property
    def done(self) -> bool:
        """Whether the end time is reached."""
        return self.clock.done

    def advance(self) -> None:
        """Do one step.

        Raises:
            Diverged: a position or velocity is not a number, or the pressure solver failed.
        """
        domain, clock = self.domain, self.clock
        particles = domain.particles
        speed = particles.largest_norm("velocity", ANY)
        if clock.step == 0:
            self._acceleration = float(np.linalg.norm(domain.gravity.at(0.0)))
            if domain.gravity.stiffness:
                reach = np.abs(particles.numpy("position") - domain.gravity.focus).max()
                self._acceleration += domain.gravity.stiffness * float(reach)
        if not np.isfinite(speed):
            raise self._diverged("a velocity is not a number")
        dt = clock.next_dt(
            domain.lattice,
            speed,
            self._acceleration / self.step.steadiness**2,
            self.step.viscosity.max_dt(domain.lattice, self.step.viscosity.largest(particles, self._viscosity)),
            min((body.max_dt() for body in domain.bodies), default=inf),
        )
        try:
            figures = self.step(domain, clock.time, dt)
        except NotConverged as error:
            raise self._diverged(f"the pressure solver failed: {error}") from error
        # Of rows of every kind: sorting within the step leaves this field behind, while the kinds move.
        self._acceleration = particles.largest_norm("acceleration", ANY)
        clock.advance(dt)
        self.statistics = {"dt": dt, **figures}
        if "collisions" in particles.fields:
            self.statistics["collisions"] = particles.total("collisions", FLUID)

    def snapshot(self) -> Snapshot:
        """Return the present state as NumPy arrays, copied when asked for; the same object until the next step."""
        if self._snapshot is None or self._snapshot.step != self.step_index:
            domain = self.domain
            self._snapshot = Snapshot(
                self.fetch,
                time=self.time,
                step=self.step_index,
                dt=self.dt,
                spacing=domain.lattice.spacing,
                dimension=domain.lattice.dimension,
                gravity=domain.gravity.at(self.time),
                n0=self.step.number_density.n0(domain.lattice),
                bodies=tuple(body.name for body in domain.bodies),
                fields=domain.particles.fields,
            )
        return self._snapshot

    @property
    def stage_times(self) -> dict[str, float]:
        """Wall time [s] spent in each stage of the step, by this process."""
        return stage_times

    def run(self, until: float = inf, after_step: Callable[["Simulation"], Any] | None = None) -> None:
        """Advance to the end, or until the time ``until`` [s] is passed, calling ``after_step`` after each step."""
        while not self.done and self.time < until:
            self.advance()
            if after_step is not None:
                after_step(self)

    def fetch(self, name: str) -> NDArray[Any]:
        """Return a copy of a field, shape (count, *shape)."""
        return np.asarray(self.domain.particles.numpy(name))

    def _diverged(self, reason: str) -> Diverged:
        x, u = self.fetch("position"), self.fetch("velocity")
        bad = ~np.isfinite(u).all(axis=1) | ~np.isfinite(x).all(axis=1)
        row = int(np.argmax(bad)) if bad.any() else int(np.argmax(np.linalg.norm(u, axis=1)))
        where = ", ".join(f"{v:.5g}" for v in x[row])
        return Diverged(
            f"step {self.clock.step + 1}, t = {self.clock.time:.6g} s: {reason}; particle {self.fetch('id')[row]} at "
            f"({where}) m with {np.linalg.norm(u[row]):.4g} m/s. Likely a time step too large or particles started too "
            f"close: lower time.courant (now {self.clock.courant:g}), or look at the last frame for overlapping rows."
        )


def device_name() -> str:
    """Return the device that kernels run on."""
    return kernels.runtime().device
