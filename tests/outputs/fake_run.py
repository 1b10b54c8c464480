"""A tank of water on a lattice, and a run of snapshots without a solver."""

from types import SimpleNamespace

import numpy as np

from spume.geometry.layers import exposed_faces
from spume.outputs.output import OutputSettings
from spume.outputs.snapshot import DUMMY, FLUID, WALL, Snapshot

GRAVITY = 9.81
DENSITY = 1000.0
N0 = 6.5
LAYERS = 3


def tank(spacing, length, depth, height, width=None, jitter=0.0, seed=0):
    """Rows of a tank open at the top and filled to `depth`, at rest; 3D if it has a width."""
    size = [length, height] if width is None else [length, width, height]
    d = len(size)
    counts = [round(s / spacing) for s in size]
    ranges = [np.arange(-LAYERS, n + LAYERS) for n in counts[:-1]] + [np.arange(-LAYERS, counts[-1])]
    index = np.stack(np.meshgrid(*ranges, indexing="ij"), axis=-1).reshape(-1, d)
    position = (index + 0.5) * spacing
    outside = np.any(index[:, :-1] < 0, axis=1) | np.any(index[:, :-1] >= counts[:-1], axis=1)
    outside |= index[:, -1] < 0
    upper = np.append(np.array(counts[:-1]) * spacing, np.inf)
    to_surface = np.where(outside[:, None], np.clip(position, 0.0, upper) - position, 0.0)
    first = np.abs(to_surface).max(axis=1) < 0.6 * spacing
    kind = np.where(outside, np.where(first, WALL, DUMMY), FLUID)
    keep = outside | (position[:, -1] < depth)
    position, kind, to_surface = position[keep], kind[keep], to_surface[keep]
    fluid = kind == FLUID
    noise = np.random.default_rng(seed).uniform(-jitter, jitter, position.shape) * spacing
    position = np.where(fluid[:, None], position + noise, position)
    n = len(position)
    exposed = np.zeros(n, dtype=int)
    exposed[~fluid] = exposed_faces(np.round(position[~fluid] / spacing - 0.5).astype(int))
    return {
        "position": position,
        "velocity": np.zeros((n, d)),
        "pressure": DENSITY * GRAVITY * np.maximum(depth - position[:, -1], 0.0),
        "number_density": np.full(n, N0),
        "density": np.full(n, DENSITY),
        "free_surface": (fluid & (position[:, -1] > depth - spacing)).astype(int),
        "kind": kind,
        "body": np.where(fluid, -1, 0),
        "material": np.zeros(n, dtype=int),
        "wall_acceleration": np.where(fluid[:, None], 0.0, np.append(np.zeros(d - 1), -GRAVITY)),
        "to_surface": to_surface,
        "exposed": exposed,
        "id": np.arange(n),
    }


def snapshot_of(rows, spacing, time=0.0, step=0, dt=0.01):
    """A snapshot of rows, in an order that changes from step to step as a solver's would."""
    d = rows["position"].shape[1]
    order = np.random.default_rng(step).permutation(len(rows["id"]))
    return Snapshot(
        lambda name: rows[name][order],
        time=time,
        step=step,
        dt=dt,
        spacing=spacing,
        dimension=d,
        gravity=np.append(np.zeros(d - 1), -GRAVITY),
        n0=N0,
        bodies=("tank",),
        fields={"pressure": SimpleNamespace(unit="Pa", doc="pressure", output=True)},
    )


class Simulation:
    """Water that rises and falls evenly: position + A sin(ωt), pressure as at rest."""

    def __init__(self, spacing=0.1, width=None, dt=0.013):
        self.rows = tank(spacing, 1.0, 0.5, 1.0, width)
        self.spacing, self.dt, self.time, self.step_index = spacing, dt, 0.0, 0
        self.statistics = {}
        self.stage_times = {"pressure": 0.25}
        self.start = self.rows["position"].copy()
        self._snapshot = None

    def advance(self):
        self.time += self.dt
        self.step_index += 1
        self.statistics = {"iterations": self.step_index, "residual": 1e-7, "removed": 0, "collisions": 2.0}
        if self.step_index > 3:
            self.statistics["clipped"] = 1
        fluid = self.rows["kind"] == FLUID
        lift = 0.02 * np.sin(10.0 * self.time)
        moved = self.start.copy()
        moved[fluid, -1] += lift
        velocity = np.zeros_like(moved)
        velocity[fluid, 0] = 0.1 * self.time
        self.rows = self.rows | {"position": moved, "velocity": velocity}
        self._snapshot = None

    def state(self, fields=()):
        names = ("position", "velocity", *fields)
        return {f"particles/{name}": self.rows[name] for name in names}, {"time": self.time, "step": self.step_index}

    def snapshot(self):
        if self._snapshot is None:
            self._snapshot = snapshot_of(self.rows, self.spacing, self.time, self.step_index, self.dt)
        return self._snapshot


def make_run(folder, gauges=(), references=(), settings=None, end=0.5, simulation=None):
    """A run object, before its first step."""
    case = SimpleNamespace(
        title="A tank",
        time=SimpleNamespace(end=end),
        gauge=tuple(gauges),
        reference=tuple(references),
        to_toml=lambda folder=None: "",
        output=settings or OutputSettings(animation="none"),
    )
    return SimpleNamespace(
        simulation=simulation or Simulation(),
        case=case,
        folder=folder,
        status="running",
        device="cpu",
        threads=2,
        precision="double",
    )


def complete(run, outputs):
    """Make all steps of a run."""
    outputs.start(run)
    while run.simulation.time < run.case.time.end:
        run.simulation.advance()
        outputs.after_step(run)
    run.status = "finished"
    outputs.finish(run)
