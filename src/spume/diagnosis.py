"""What makes a state no flow any more, and what to do about it."""

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from math import inf, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume import kernels
from spume.clock import Clock
from spume.domain import Domain
from spume.pairs import pair_max, pair_term, row_map, row_term
from spume.particles import ANY, FLUID, SOLID, Field
from spume.schemes.weight.inverse import Inverse

log = logging.getLogger("spume")

FASTEST = 10.0
"""Speeds beyond this many times what fall, initial motion and walls can give are beyond reason [1]."""

FAST_STEPS = 5
"""Steps in a row that such a speed must last: a single row may be thrown out of an impact."""

SMALLEST_STEP = 1e-4
"""A time step below this part of the largest one so far has collapsed [1]."""

MOST_STEPS = 1e9
"""A run that would take more steps than this to its end does not reach it: weeks at 1 ms a step."""

BEHIND = 0.5
"""A row whose centre is farther than this behind a wall's surface has gone through it [l0]."""

DEEPEST = 2.25
"""Farther behind than this it is outside of walls of three layers: what flew over the rim falls down there [l0]."""

LEAKED = (3, 1e-3)
"""Rows, and part of the fluid's rows, behind walls at which a run stops (both are needed); one is a warning."""

LOOK = 5
"""Steps between two searches for rows behind walls."""

WINDOW = 100
"""Steps over which the uses of limiters are averaged."""

OFTEN = {"collisions": 0.02, "clipped": 0.01, "fallbacks": 0.05}
"""Uses of limiters a step that are warned of [1].

Collisions per fluid row, clipped pressures per fluid row off the free surface, fallbacks per step.
"""

LOST = 1e-2
"""Part of the fluid's rows that may leave the region before a second warning [1]."""

CLEARANCE = Field("wall_clearance", (), "m", "fluid rows: height in front of the walls nearby, negative behind them")

BEHIND_WALL = Field("behind_wall", (), "1", "1 where a fluid row has gone through a wall", scratch="watch")

_AROUND = 0.87  # l0: no place between the rows of a wall is farther from one of them
_NEAR = 1.5  # l0: reach of the search for walls; the lists hold at least 2 l0


class Diverged(RuntimeError):
    """The state is no longer a flow; the message says when, where, why and what helps.

    Attributes:
        details: the same as numbers: step, time, particle, position, velocity, reason, cause, remedy.
    """

    def __init__(self, message: str, details: Mapping[str, Any] | None = None) -> None:
        super().__init__(message)
        self.details = dict(details or {})


@dataclass(frozen=True)
class Finding:
    """What is wrong with a state.

    Attributes:
        reason: what was found.
        cause: what it likely comes from.
        remedy: what helps.
        row: row number of the particle that shows it; None: the one that is fastest or not a number.
    """

    reason: str
    cause: str
    remedy: str
    row: int | None = None


@pair_term(reads=("to_surface",))
def height(a, b, r, w, l0):  # type: ignore[no-untyped-def]
    """Return how far a row lies in front of the surface that a solid row's own cell covers [m]; beside it: nothing."""
    size = b.to_surface.norm(1e-30)
    along = r.dot(b.to_surface) / size
    beside = r - along / size * b.to_surface
    # Above the rim of a wall there is no wall: what flies over a tank's edge has not gone through it. And of a tip that
    # is one row thick the surface may be on its other side: what is in a wall has rows of it nearer than a spacing.
    covered = abs(beside).max() < 0.5 * l0 and (along < 0.0 or r.norm() < _AROUND * l0)
    return kernels.qd.select(covered, -along - size, -1e30)


@row_term(reads=("wall_clearance",))
def is_behind(a, surface, deepest):  # type: ignore[no-untyped-def]
    """Return 1 where a row is behind a wall's surface, and not farther than walls are thick."""
    return kernels.qd.select((a.wall_clearance < surface) & (a.wall_clearance > deepest), 1.0, 0.0)


class Watch:
    """Judges each step: is the state still a flow, and do limiters act more than they should?

    What it looks at every step is known anyway; every ``LOOK`` steps it sums once over the neighbours. It changes
    no field that a step reads.
    """

    def __init__(self, domain: Domain, clock: Clock) -> None:
        self._domain, self._clock = domain, clock
        particles = domain.particles
        particles.declare((CLEARANCE, BEHIND_WALL))
        x, kind = particles.numpy("position"), particles.numpy("kind")
        self._fluid = max(int(np.count_nonzero(kind == FLUID)), 1)
        self._low: NDArray[Any] = x.min(axis=0, initial=inf)
        self._high: NDArray[Any] = x.max(axis=0, initial=-inf)
        self._own_speed = 0.0
        self._fall = 0.0  # largest of 2 g . extent so far [m^2/s^2]
        self._pull = 0.0  # largest acceleration so far [m/s^2]
        self._fast = 0
        self._largest_dt = 0.0
        self._steps = 0
        self._uses: dict[str, float] = {}
        self._removed = 0.0
        self._warned: set[str] = set()

    def state(self) -> dict[str, Any]:
        """Return what `restore` takes, as numbers and text."""
        return {
            "fluid": self._fluid, "low": self._low.tolist(), "high": self._high.tolist(),
            "own_speed": self._own_speed, "fall": self._fall, "pull": self._pull, "fast": self._fast,
            "largest_dt": self._largest_dt, "steps": self._steps, "uses": dict(self._uses),
            "removed": self._removed, "warned": sorted(self._warned),
        }  # fmt: skip

    def restore(self, state: Mapping[str, Any]) -> None:
        """Go on from where `state` was taken."""
        for name, value in state.items():
            setattr(self, f"_{name}", value)
        self._low, self._high = np.array(state["low"]), np.array(state["high"])
        self._uses, self._warned = dict(state["uses"]), set(state["warned"])

    def before_step(self, speed: float, dt: float) -> Finding | None:
        """Judge the largest speed [m/s] and the time step [s] that is about to be made."""
        clock = self._clock
        if clock.step == 0:
            self._own_speed = speed
        limit = FASTEST * self._reasonable_speed(False)
        if speed > limit:
            limit = FASTEST * self._reasonable_speed(True)
        self._fast = self._fast + 1 if speed > limit else 0
        if self._fast >= FAST_STEPS:
            return Finding(
                f"a speed of {speed:.4g} m/s, for {self._fast} steps more than {FASTEST:g} times what fall, initial "
                f"motion and walls can give ({limit / FASTEST:.3g} m/s)",
                "the step is unstable: too long for these models, or particles that were pressed together fly apart",
                f"{clock.shorter}, refine the spacing, or choose the default models",
            )
        if dt < SMALLEST_STEP * self._largest_dt or clock.time + dt == clock.time:
            return Finding(
                f"the time step collapsed to {dt:.3g} s, limited by {clock.limiter}; the largest was "
                f"{self._largest_dt:.3g} s",
                "a few particles are accelerated ever more, most often where a wall, a gap or two bodies hold them",
                "look at the particle in the last frame; refine the spacing there or widen the gap",
            )
        self._largest_dt = max(self._largest_dt, dt)
        if (left := clock.end - clock.time) > MOST_STEPS * dt:
            return Finding(
                f"the time step collapsed to {dt:.3g} s, limited by {clock.limiter}; the {left:.3g} s to the end would "
                f"take {left / dt:.2g} steps, more than {MOST_STEPS:g}",
                "a speed, an acceleration, a viscosity or a motion in other units than SI, or an end that is too far",
                "check time.end and what the message names as the limit; spume check predicts the number of steps",
            )
        return None

    def _reasonable_speed(self, thorough: bool) -> float:
        """Return the speed [m/s] that a fall over everything there is, initial motion and walls give together."""
        domain, clock = self._domain, self._clock
        if thorough:
            x = domain.particles.numpy("position")
            x = x[np.isfinite(x).all(axis=1)]
            if len(x):
                self._low, self._high = np.minimum(self._low, x.min(axis=0)), np.maximum(self._high, x.max(axis=0))
            if "wall_velocity" in domain.particles.fields:
                self._own_speed = max(self._own_speed, domain.particles.largest_norm("wall_velocity", SOLID))
        extent = self._high - self._low
        g = np.abs(domain.gravity.at(clock.time))
        central = domain.gravity.stiffness * float(extent @ extent)
        self._fall = max(self._fall, 2.0 * float(g @ extent) + central)
        self._pull = max(self._pull, float(np.linalg.norm(g)))
        # Through a periodic boundary a fall has no end.
        endless = self._pull * clock.time if any(domain.pairs.periodic) else 0.0
        reasonable = self._own_speed + sqrt(self._fall) + endless
        return reasonable if reasonable > 0.0 else inf

    def after_step(self, statistics: Mapping[str, float]) -> Finding | None:
        """Judge the state that a step left, and warn of limiters that act often."""
        self._count(statistics)
        if self._clock.step % LOOK:
            return None
        return self._leaks()

    def _leaks(self) -> Finding | None:
        domain = self._domain
        particles, l0 = domain.particles, domain.lattice.spacing
        if not domain.bodies:
            return None
        pair_max(
            height, particles, domain.pairs, out="wall_clearance", weight=Inverse(), re=_NEAR * l0, over=SOLID,
            arguments=(l0,),
        )  # fmt: skip
        row_map(is_behind, particles, out="behind_wall", arguments=(-BEHIND * l0, -DEEPEST * l0))
        if particles.total("behind_wall", FLUID) == 0.0:
            return None
        clearance, kind = particles.numpy("wall_clearance"), particles.numpy("kind")
        behind = (kind == FLUID) & (particles.numpy("behind_wall") > 0.0)
        number = int(np.count_nonzero(behind))
        row = int(np.argmin(np.where(behind, clearance, inf)))
        if number < LEAKED[0] or number < LEAKED[1] * self._fluid:
            self._warn_once(
                "leak",
                f"{number} of {self._fluid} fluid particles behind a wall, the deepest is "
                f"{self._particle(row)}; the run goes on and is not told again",
            )
            return None
        return Finding(
            f"{number} of {self._fluid} fluid particles went through a wall, the deepest is "
            f"{-clearance[row] / l0:.2g} spacings behind its surface",
            "the wall moves or is hit too fast for the time step, or is thinner than its layers",
            f"{self._clock.shorter}, refine the spacing or give the body more layers",
            row,
        )

    def _count(self, statistics: Mapping[str, float]) -> None:
        """Add up uses of limiters, and warn once of each that acts too often."""
        gone = float(statistics.get("removed", 0))
        if gone:
            self._removed += gone
            text = f"{self._removed:.0f} of {self._fluid} fluid particles left the region and were removed"
            if self._removed < LOST * self._fluid:
                self._warn_once("removed", f"{text}; walls that are open or leak, or domain.lower and upper too narrow")
            else:
                self._warn_once("lost", f"{text}: more than {LOST:.0%}, the fluid is being lost")
        self._steps += 1
        for name in OFTEN:
            self._uses[name] = self._uses.get(name, 0.0) + float(statistics.get(name, 0))
        if self._steps < WINDOW:
            return
        for name, limit in OFTEN.items():
            share = self._uses[name] / self._steps / self._could(name)
            if share > limit:
                self._warn_once(name, _SENTENCES[name].format(share=share, steps=self._steps))
        self._steps, self._uses = 0, {}

    def _could(self, limiter: str) -> float:
        """Return how often a limiter could act in a step: pressures are clipped where the surface gives none."""
        if limiter == "fallbacks":
            return 1.0
        if limiter == "clipped" and self._uses[limiter] > 0.0:
            return max(self._fluid - self._domain.particles.total("free_surface", FLUID), 1.0)
        return float(self._fluid)

    def _warn_once(self, name: str, text: str) -> None:
        if name not in self._warned:
            self._warned.add(name)
            log.warning("step %d, t = %.6g s: %s", self._clock.step, self._clock.time, text)

    def _particle(self, row: int) -> str:
        particles = self._domain.particles
        x = particles.numpy("position")[row]
        return f"{particles.numpy('id')[row]} at {place(x)} m"

    def diverged(self, finding: Finding, step: int, time: float) -> Diverged:
        """Return the error that names the particle of a finding.

        Args:
            finding: what is wrong.
            step, time: number and start [s] of the step that failed.
        """
        particles = self._domain.particles
        x, u = particles.numpy("position"), particles.numpy("velocity")
        row = finding.row
        if row is None:
            bad = ~np.isfinite(u).all(axis=1) | ~np.isfinite(x).all(axis=1)
            row = int(np.argmax(bad)) if bad.any() else int(np.argmax(np.linalg.norm(u, axis=1)))
        number = int(particles.numpy("id")[row])
        speed = float(np.linalg.norm(u[row]))
        message = (
            f"step {step}, t = {time:.6g} s: {finding.reason}; particle {number} at {place(x[row])} m with "
            f"{speed:.4g} m/s. Likely cause: {finding.cause}. Remedy: {finding.remedy}."
        )
        details = {
            "step": step, "time": time, "particle": number, "position": [float(c) for c in x[row]],
            "velocity": [float(c) for c in u[row]], "reason": finding.reason, "cause": finding.cause,
            "remedy": finding.remedy,
        }  # fmt: skip
        return Diverged(message, details)


_SENTENCES = {
    "collisions": "collisions act on {share:.0%} of the fluid particles a step (mean of {steps} steps): the time step "
    "is long for this flow, lower time.courant and time.travel",
    "clipped": "{share:.0%} of the pressures inside the fluid were negative and set to zero (mean of {steps} steps), "
    "a force that the flow does not have: set step.negative_pressure = true with a gradient that bears tension",
    "fallbacks": "the pressure solver needed its fallback in {share:.0%} of {steps} steps: it costs time, not "
    "accuracy; choose step.solver = cg, or report the case",
}


def place(x: Any) -> str:
    """Return a position as text."""
    return f"({', '.join(f'{c:.5g}' for c in x)})"


def not_a_number(clock: Clock) -> Finding:
    """Return the finding of a velocity that is not a number."""
    return Finding(
        "a velocity is not a number",
        "a time step too large, or particles that started too close",
        f"{clock.shorter}, or look at the last frame, which shows this state, for overlapping particles",
    )


def not_solved(error: Exception, domain: Domain, clock: Clock) -> Finding:
    """Return the finding of a pressure solve that failed: the row whose equation is satisfied worst."""
    particles = domain.particles
    if not np.isfinite(particles.largest_norm("velocity", ANY)):
        return not_a_number(clock)
    row = None
    for name in particles.fields:
        if name.endswith("residual") and particles.fields[name].shape == ():
            rest = np.abs(particles.numpy(name))
            if np.isfinite(rest).any() and np.nanmax(rest) > 0.0:
                row = int(np.nanargmax(rest))
    single = kernels.runtime().precision == "single"
    return Finding(
        f"the pressure solver failed: {error}",
        "a tolerance that single precision cannot reach, or particles that lie on one another"
        if single
        else "particles that lie on one another, or that a wall encloses: the matrix is nearly singular there",
        ("compute in double precision, raise step.solver.tolerance" if single else "raise step.solver.tolerance")
        + f" or step.solver.largest_iterations, {clock.shorter}",
        row,
    )


def crowded(error: Exception, domain: Domain, clock: Clock) -> Finding:
    """Return the finding of a list of neighbours that overflowed: a row of the fullest cell."""
    x = domain.particles.numpy("position")
    good = np.flatnonzero(np.isfinite(x).all(axis=1))
    cells = np.floor(x[good] / domain.lattice.spacing).astype(np.int64)
    _, first, number = np.unique(cells, axis=0, return_index=True, return_counts=True)
    row = int(good[first[np.argmax(number)]]) if len(good) else None
    return Finding(
        f"the list of neighbours overflowed: {error}",
        "particles are pressed or drawn together: shifting is off, two fluids overlap, or a body moves into another",
        f"choose the default shifting and collision, {clock.shorter}, or keep bodies apart",
        row,
    )
