"""A rolling tank for ten periods, in both frames of reference: nothing through a wall, the volume kept."""

from __future__ import annotations

import math

import numpy as np

from spume.validation import Bar, Folder, Measured, Panel, Run, Study

LENGTH, HEIGHT, DEPTH, PERIOD = 0.6, 0.36, 0.12, 1.17479
THROUGH = "particles through a wall or lost"
VOLUME = "|volume of the last two periods / that of the first two − 1|"


def measure(folder: Folder) -> Measured:
    """Return how many particles pass a wall, and how the volume changes.

    A particle is through a wall when its centre is behind those of the first wall layer, l0/2 behind the face.
    """
    motion = folder.case.domain.motion if folder.case.domain.frame == "laboratory" else None
    passed: set[int] = set()
    through: set[int] = set()
    deepest = -math.inf
    for frame in folder.frames():
        x = frame["position"] if motion is None else motion.pose(frame.time, 2).origin(frame["position"])
        depth = np.maximum(-x, x - np.array([LENGTH, HEIGHT])).max(axis=1)
        passed |= set(frame["id"][depth > 0.0].tolist())
        through |= set(frame["id"][depth > 0.5 * frame.spacing].tolist())
        deepest = max(deepest, float(depth.max()) / frame.spacing)
    fluid = folder.log["particles_fluid"]
    volume, level = folder.gauge("volume"), folder.gauge("left")
    t, v = volume["time"] / PERIOD, volume["volume"]
    first, last = v[(t > 0.0) & (t < 2.0)].mean(), v[t >= t[-1] - 2.0].mean()
    return Measured(
        {
            THROUGH: float(len(through) + fluid[0] - fluid[-1]),
            VOLUME: abs(float(last / first - 1.0)),
            "particles whose centre passes a face": float(len(passed)),
            "deepest centre behind a face / l0": deepest,
        },
        {"level 0.05 m from the left wall": (level["time"] / PERIOD, level["elevation"])},
    )


def _run(frame: str, cells: int) -> Run:
    return Run("rolling-tank", cells, (f"spacing={DEPTH / cells!r}", f"domain.frame='{frame}'"), frame)


STUDY = Study(
    number="7e",
    title="Rolling tank, ten periods",
    length="depth/l0",
    reference="what must hold: no particle passes a wall, the volume stays; both frames of reference",
    runs=tuple(_run(frame, n) for frame in ("tank", "laboratory") for n in (6, 12)),
    quick=(),
    measure=measure,
    bars=tuple(
        bar
        for frame in ("tank", "laboratory")
        for bar in (Bar(THROUGH, 0.0, 0.0, series=frame, cells=12), Bar(VOLUME, 0.005, series=frame, cells=12))
    ),
    panels={"level 0.05 m from the left wall": Panel("t / T", "level [m]")},
)
