"""What a step costs: wall time, bytes and bandwidth by stage, without output."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, field
from statistics import median
from typing import TYPE_CHECKING, Any

import numpy as np

from spume import kernels
from spume.build import build
from spume.outputs.summary import peak_memory

if TYPE_CHECKING:
    from spume.case import Case
    from spume.simulation import Simulation

WARM_UP = 3
"""Steps before the measurement: kernels are compiled, storage has grown to its size."""


@dataclass
class Stage:
    """Cost of one stage.

    Attributes:
        name: the stage.
        seconds: wall time a step [s].
        bytes: bytes that it moves at least in a step, each value counted once; None where they are not counted.
    """

    name: str
    seconds: float
    bytes: float | None


@dataclass
class Result:
    """What a benchmark measured.

    Attributes:
        case, spacing, dimension, device, threads, precision: what was run.
        fluid, rows, active: particles; rows of the table; rows near fluid, which take part.
        steps, simulated: steps that were measured and the time [s] that they cover.
        seconds: wall time of those steps [s].
        median_step: median wall time of a step [s].
        compilation: wall time of the first steps, compilation included [s].
        mean_dt: mean time step [s].
        iterations: mean iterations of the pressure solver.
        density_error: mean over interior fluid rows of |n - n0|/n0 at the end [1].
        copy: bandwidth of a copy measured in the same run [bytes/s], read and written bytes.
        peak_memory: largest memory of the process [bytes]; table_memory: that of the particle table, its
            neighbour lists and the pressure matrix.
        stages: by stage.
    """

    case: str
    spacing: float
    dimension: int
    device: str
    threads: int
    precision: str
    fluid: int
    rows: int
    active: int
    steps: int
    simulated: float
    seconds: float
    median_step: float
    compilation: float
    mean_dt: float
    iterations: float
    density_error: float
    copy: float
    peak_memory: int
    table_memory: int
    stages: list[Stage] = field(default_factory=list)

    @property
    def microseconds(self) -> float:
        """Wall time per fluid particle and step [us], median."""
        return self.median_step / max(self.fluid, 1) * 1e6

    def to_json(self) -> dict[str, Any]:
        """Return the figures as plain values."""
        return asdict(self) | {
            "us_per_fluid_particle_step": self.microseconds,
            "us_per_row_step": self.median_step / max(self.rows, 1) * 1e6,
            "simulated_per_wall_second": self.simulated / self.seconds if self.seconds else None,
        }


def bench(
    case: Case,
    steps: int | None = None,
    *,
    device: str | None = None,
    threads: int | None = None,
    precision: str | None = None,
) -> Result:
    """Run a case without output and measure its steps.

    Args:
        case: the case.
        steps: steps to measure, after ``WARM_UP`` others; default: to the case's end.
        device, threads, precision: override the case's.

    Raises:
        CaseError, Diverged: see `run`.
    """
    simulation = build(case, device, threads, precision)
    domain, particles, stages = simulation.domain, simulation.particles, simulation.domain.stages
    begin = time.perf_counter()
    while simulation.step_index < WARM_UP and not simulation.done:
        simulation.advance()
    kernels.wait()
    compilation = time.perf_counter() - begin
    entries = domain.pairs.list.entries(particles)
    stages.meter = lambda: float(particles.traffic + 4 * entries * particles.visits)
    if kernels.runtime().wide:
        stages.settle = kernels.wait
    stages.times.clear()
    stages.amounts.clear()
    start, fluid = simulation.time, int(simulation.snapshot().fluid.sum())
    times: list[float] = []
    iterations: list[float] = []
    while not simulation.done and (steps is None or len(times) < steps):
        begin = time.perf_counter()
        simulation.advance()
        kernels.wait()
        times.append(time.perf_counter() - begin)
        iterations.append(simulation.statistics.get("iterations", 0.0))
    count = max(len(times), 1)
    found = [Stage(n, s / count, stages.amounts.get(n, 0.0) / count or None) for n, s in stages.times.items()]
    rest = sum(times) - sum(stages.times.values())
    found.append(Stage("rest", rest / count, None))
    memory = peak_memory() or 0  # before the copy, which needs its own
    runtime = kernels.runtime()
    return Result(
        case=case.origin.label or "case",
        spacing=case.spacing,
        dimension=case.dimension,
        device=runtime.device,
        threads=runtime.threads,
        precision=runtime.precision,
        fluid=fluid,
        rows=particles.count,
        active=particles.active,
        steps=len(times),
        simulated=simulation.time - start,
        seconds=sum(times),
        median_step=median(times) if times else 0.0,
        compilation=compilation,
        mean_dt=(simulation.time - start) / count,
        iterations=float(np.mean(iterations)) if iterations else 0.0,
        density_error=density_error(simulation),
        copy=copy_bandwidth(),
        peak_memory=memory,
        table_memory=_table_memory(simulation),
        stages=sorted(found, key=lambda stage: -stage.seconds),
    )


def density_error(simulation: Simulation) -> float:
    """Return the mean over interior fluid rows of |n - n0|/n0."""
    state = simulation.snapshot()
    inner = state.fluid & (state["free_surface"] == 0)
    if not inner.any() or not np.isfinite(state.n0):
        return float("nan")
    return float(np.mean(np.abs(state["number_density"][inner] / state.n0 - 1.0)))


def copy_bandwidth(megabytes: int = 256) -> float:
    """Return the bandwidth [bytes/s] of a copy with the threads of the runtime: the better half of 9, median."""
    size = megabytes * 125_000
    real = kernels.runtime().real
    source, target = kernels.array(real, size), kernels.array(real, size)
    kernel = _copy_kernel()
    times = []
    for _ in range(9):
        begin = time.perf_counter()
        kernel(source, target, size)
        kernels.wait()
        times.append(time.perf_counter() - begin)
    moved = 2 * size * kernels.runtime().dtype().itemsize
    return moved / median(sorted(times)[:5])


def _table_memory(simulation: Simulation) -> int:
    domain, particles = simulation.domain, simulation.particles
    return int(particles.bytes() + domain.pairs.list.bytes() + domain.system.bytes())


@kernels.cached
def _copy_kernel() -> Any:
    source = (
        "def copy(source: Reals, target: Reals, count: qd.i32):\n"
        "    qd.loop_config(serialize=serial)\n"
        "    for i in range(count):\n"
        "        target[i] = source[i]\n"
    )
    runtime = kernels.runtime()
    return kernels.compiled("copy", source, Reals=kernels.array_type(runtime.real), serial=runtime.serial)
