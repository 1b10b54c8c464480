"""A simulation: a domain, a step and a clock."""

from collections.abc import Callable, Iterable, Mapping
from math import inf, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spume import kernels
from spume.clock import Clock
from spume.diagnosis import Diverged, Finding, Watch, crowded, not_a_number, not_solved
from spume.domain import Domain
from spume.outputs.snapshot import Snapshot
from spume.particles import ANY, FLUID
from spume.pressure.base import NotConverged
from spume.search import TooManyNeighbours
from spume.steps.base import Step

_INSTANTS, _INSTANTS_AT_FIRST = 2, 256
"""Instants of a step, and of the first, at which is asked what is prescribed."""

State = tuple[dict[str, NDArray[Any]], dict[str, Any]]
"""Arrays by name, and numbers and text that JSON takes."""


class Simulation:
    """Advances a domain in time.

    Args:
        domain: what is advanced.
        step: how.
        clock: how fast, and until when.

    Attributes:
        statistics: figures of the last step: dt, iterations, residual, removed rows, uses of limiters.
        watch: what judges the steps.
    """

    def __init__(self, domain: Domain, step: Step, clock: Clock) -> None:
        self.domain = domain
        self.step = step
        self.clock = clock
        self.statistics: dict[str, float] = {}
        domain.particles.declare(step.needed_fields())
        self._viscosity = float(np.max(domain.particles.numpy("kinematic_viscosity"), initial=0.0))
        self._prescribed = domain.prescribed
        self._acceleration = 0.0
        self._relative_speed = 0.0
        self._snapshot: Snapshot | None = None
        self._broken = 0.0  # length of the step that failed half-way [s]
        self.watch = Watch(domain, clock)

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
            Diverged: the state is no longer a flow (see `spume.diagnosis`); `snapshot` then shows what is left of it.
            RuntimeError: the end is reached (`done`).
        """
        if self.done:
            raise RuntimeError(
                f"no step is left: the end, t = {self.clock.end:g} s, is reached (simulation.done); for more, build "
                "the case with a later time.end"
            )
        domain, clock = self.domain, self.clock
        particles = domain.particles
        with domain.stages("limits"):
            speed = particles.largest_norm("velocity", ANY)
        if clock.step == 0:
            try:
                self.step.begin(domain)
            except TooManyNeighbours as error:
                raise self._diverged(crowded(error, domain, clock)) from error
            self._relative_speed = self.step.relative_speed(domain)
            self._acceleration = float(np.linalg.norm(domain.gravity.at(0.0)))
            if domain.gravity.stiffness:
                reach = np.abs(particles.numpy("position") - domain.gravity.focus).max()
                self._acceleration += domain.gravity.stiffness * float(reach)
        if not np.isfinite(speed):
            raise self._diverged(not_a_number(clock))
        dt = clock.next_dt(
            domain.lattice,
            speed,
            self._relative_speed,
            self._acceleration / self.step.steadiness**2,
            self.step.viscosity.max_dt(domain.lattice, self.step.viscosity.largest(particles, self._viscosity)),
            clock.courant * domain.max_dt(clock.time),
            self.step.max_dt(domain, speed),
        )
        if self._prescribed:
            dt = clock.eased(dt, self._coming(dt))
        finding = self.watch.before_step(speed, dt)
        if finding is not None:
            raise self._diverged(finding)
        try:
            figures = self.step(domain, clock.time, dt, clock.dt)
        except NotConverged as error:
            raise self._diverged(not_solved(error, domain, clock), dt) from error
        except TooManyNeighbours as error:
            raise self._diverged(crowded(error, domain, clock), dt) from error
        self._acceleration = figures.pop("acceleration")
        with domain.stages("limits"):
            self._relative_speed = self.step.relative_speed(domain)
        clock.advance(dt)
        kernels.review_threads()
        self.statistics = {"dt": dt, **figures}
        if "collisions" in particles.fields:
            self.statistics["collisions"] = particles.total("collisions", FLUID)
        finding = self.watch.after_step(self.statistics)
        if finding is not None:
            raise self.watch.diverged(finding, clock.step, clock.time)

    def _coming(self, dt: float) -> float:
        """Return what is prescribed in the next dt [s] allows as a time step, at a Courant number of one [s].

        A first step without gravity and speed may be as long as the run, so it is looked at closely.
        """
        domain, t = self.domain, self.clock.time
        instants = t + dt * np.linspace(0.0, 1.0, (_INSTANTS if self.clock.step else _INSTANTS_AT_FIRST) + 1)[1:]
        largest = max(float(np.linalg.norm(domain.force(s).uniform)) for s in instants)
        shaken = self.step.steadiness * sqrt(domain.lattice.spacing / largest) if largest > 0.0 else inf
        return min(shaken, *(domain.max_dt(s) for s in instants))

    def snapshot(self) -> Snapshot:
        """Return the present state as NumPy arrays, copied when asked for; the same object until the next step.

        After a step that failed half-way it is what that step left, under the number and the end of that step.
        """
        step = self.step_index + (self._broken > 0.0)
        if self._snapshot is None or self._snapshot.step != step:
            domain = self.domain
            self._snapshot = Snapshot(
                self.fetch,
                time=self.time + self._broken,
                step=step,
                dt=self.dt,
                spacing=domain.lattice.spacing,
                dimension=domain.lattice.dimension,
                gravity=domain.force(self.time).gravity,
                n0=self.step.number_density.n0(domain.lattice),
                bodies=tuple(body.name for body in domain.bodies),
                poses={body.name: body.pose(self.time, domain.lattice.dimension) for body in domain.bodies},
                fields=domain.particles.fields,
                periods=domain.pairs.periods,
                stiffness=domain.gravity.stiffness,
                focus=domain.gravity.focus,
            )
        return self._snapshot

    @property
    def stage_times(self) -> dict[str, float]:
        """Wall time [s] spent in each stage of the step."""
        return self.domain.stages.times

    def run(
        self, until: float = inf, *, every: float = 0.0, callback: Callable[["Simulation"], Any] | None = None
    ) -> None:
        """Advance to the end of the case, or until a time is reached.

        Nothing is written; ``case.run`` writes results.

        Args:
            until: time [s] at or after which to stop; the step is not shortened to meet it.
            every: simulated time between two calls [s]; 0: after each step. A call comes after the first step at
                or after each multiple, and at the end.
            callback: is called with the simulation, at the start of a new one too; it may read `snapshot`, measure
                gauges, draw. If it returns True the run stops.

        Raises:
            Diverged: see `advance`.
            ValueError: `every` is negative.
        """
        if every < 0.0:
            raise ValueError(f"every = {every:g}: a time between two calls in seconds, not negative")
        due = self._instants(every)
        called = self.step_index if self.step_index else -1
        if self.step_index == 0 and callback is not None:
            called = 0
            if callback(self) is True:
                return
        while not self.done and self.time < until:
            self.advance()
            if callback is None or self._instants(every) == due:
                continue
            due, called = self._instants(every), self.step_index
            if callback(self) is True:
                return
        if callback is not None and called != self.step_index:
            callback(self)

    def _instants(self, every: float) -> int:
        """Return how many multiples of a time [s] have passed; without one, how many steps."""
        # A thousandth of a step early is on time: multiples and the sum of the steps round differently.
        return int((self.time + 1e-3 * self.dt) / every) if every else self.step_index

    def __getitem__(self, name: str) -> NDArray[Any]:
        """Return a field of the present state, read-only, shape (rows, *shape), in SI units.

        It stays as it is when the simulation goes on; `snapshot` tells units, and which rows are fluid.

        Raises:
            KeyError: no such field.
        """
        return self.snapshot()[name]

    def plot(self, colour: str | None = None, *, dpi: int = 110, **settings: Any) -> Any:
        """Return matplotlib's figure of the particles at present.

        Args:
            colour: ``speed``, ``pressure`` or another scalar field; default: ``speed``.
            dpi: pixels per inch.
            settings: further keys of a case's ``[output]`` table: ``colour_range`` (SI units), ``map``, ``view_deg``.

        Raises:
            KeyError: no such field.
            CaseError: a setting that is not allowed.
        """
        from spume.outputs.pictures import frame_of, plot

        return plot(frame_of(self.snapshot(), None if colour in (None, "speed") else colour), colour, dpi, settings)

    def __repr__(self) -> str:
        return f"<Simulation: t = {self.time:g} of {self.clock.end:g} s, {self.step_index} steps>"

    def _repr_html_(self) -> str:
        from spume.notebook import simulation_html

        return simulation_html(self)

    def fetch(self, name: str) -> NDArray[Any]:
        """Return a copy of a field, shape (count, *shape)."""
        return np.asarray(self.domain.particles.numpy(name))

    def state(self, fields: Iterable[str] = ()) -> State:
        """Return everything that the next step reads; after `restore` the steps that follow are the same bits.

        The arrays have the shapes of the fields, (count, *shape), and of what the list and the bodies keep.

        Args:
            fields: fields to save besides those that a step reads.
        """
        domain, clock, particles = self.domain, self.clock, self.domain.particles
        chosen = [name for name, field in particles.fields.items() if field.restart or name in fields]
        arrays = {f"particles/{name}": particles.numpy(name) for name in chosen}
        neighbours, built = domain.pairs.list.state(particles)
        arrays |= {f"list/{name}": values for name, values in built.items()}
        arrays |= {f"voids/{name}": values for name, values in domain.voids.state().items()}
        for body in domain.bodies:
            arrays |= {f"bodies/{body.name}/{name}": values for name, values in body.state().items()}
        numbers = {
            "clock": {"time": clock.time, "step": clock.step, "dt": clock.dt, "limiter": clock.limiter},
            "list": neighbours,
            "next_id": particles.next_id,
            "acceleration": self._acceleration,
            "relative_speed": self._relative_speed,
            "viscosity": self._viscosity,
            "statistics": {name: float(value) for name, value in self.statistics.items()},
            "stage_times": dict(self.stage_times),
            "watch": self.watch.state(),
        }
        return arrays, numbers

    def restore(self, arrays: Mapping[str, NDArray[Any]], numbers: Mapping[str, Any]) -> None:
        """Take back a state that `state` gave, arrays of the same shapes, of the same case.

        Raises:
            KeyError: something is missing.
        """
        domain, clock, particles = self.domain, self.clock, self.domain.particles
        under: dict[str, dict[str, NDArray[Any]]] = {}
        for path, values in arrays.items():
            group, _, name = path.rpartition("/")
            under.setdefault(group, {})[name] = values
        particles.replace(under["particles"], numbers["next_id"])
        domain.pairs.list.restore(particles, numbers["list"], under.get("list", {}))
        domain.voids.restore(under.get("voids", {}))
        for body in domain.bodies:
            body.restore(under.get(f"bodies/{body.name}", {}))
        for name, value in numbers["clock"].items():
            setattr(clock, name, value)
        self._acceleration, self._viscosity = numbers["acceleration"], numbers["viscosity"]
        self._relative_speed = numbers["relative_speed"]
        self.statistics = dict(numbers["statistics"])
        self.stage_times.update(numbers["stage_times"])
        self.watch.restore(numbers["watch"])
        self._snapshot = None

    def _diverged(self, finding: Finding, half_way: float = 0.0) -> Diverged:
        """Return the error of a finding in the step that begins, and show what that step, of that length [s], left."""
        error = self.watch.diverged(finding, self.clock.step + 1, self.clock.time)
        self._broken, self._snapshot = half_way, None
        return error
