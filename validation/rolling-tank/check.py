"""Ten periods of a rolling tank at the default settings: nothing through a wall, volume kept, frames agree.

    python validation/rolling-tank/check.py [depth/l0 …]

A closed tank 0.6 m long and 0.36 m high, filled to 0.12 m, rolls by 4 degrees about the middle of its floor
with the first eigenperiod of the water, T = 2 pi/sqrt(g k tanh(k h)), k = pi/L: the waves break. A particle
is through a wall when its centre is behind those of the first wall layer, l0/2 behind the face, or when it is lost;
how many centres pass the face at all, and how far, is reported.
"""

import math
import sys
from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

from report import Bar, save, show

import spume
from spume.outputs import budgets

LENGTH, HEIGHT, DEPTH, ANGLE = 0.6, 0.36, 0.12, 4.0
WAVENUMBER = math.pi / LENGTH
PERIOD = 2.0 * math.pi / math.sqrt(9.81 * WAVENUMBER * math.tanh(WAVENUMBER * DEPTH))
PERIODS = 10


def case(frame: str, cells: int, periods: float = PERIODS) -> spume.Case:
    """Return the rolling tank at depth/l0 = cells, with the default models."""
    roll = {"kind": "sinusoid", "amplitude_deg": ANGLE, "period": PERIOD, "ramp": PERIOD}
    roll["centre"] = [LENGTH / 2, 0.0]
    water = spume.Box(lower=[0.0, 0.0], upper=[LENGTH, DEPTH])
    return spume.Case(
        spacing=DEPTH / cells,
        time=spume.Time(end=periods * PERIOD),
        domain=spume.Domain(frame=frame, motion=roll),
        fluid=[spume.Fluid(name="water", shape=water, initial="hydrostatic")],
        body=[spume.Wall(name="tank", shape=spume.Tank(lower=[0.0, 0.0], upper=[LENGTH, HEIGHT]))],
    )


def run(frame: str, cells: int) -> dict[str, object]:
    """Run one frame; return what the bars need, measured in the tank's coordinates at every step."""
    simulation = case(frame, cells).build(threads=1)
    count = int((simulation.fetch("kind") == 1).sum())
    left = spume.outputs.gauges.elevation.Elevation(name="left", at=(0.05,))
    series, passed, through, deepest, removed = [], set(), set(), 0.0, 0
    while not simulation.done:
        simulation.advance()
        removed += simulation.statistics["removed"]
        snapshot = simulation.snapshot().seen_from("tank")
        fluid = snapshot.fluid
        x = snapshot["position"][fluid]
        depth = np.maximum(-x, x - np.array([LENGTH, HEIGHT])).max(axis=1)
        ids = snapshot["id"][fluid]
        passed |= set(ids[depth > 0.0].tolist())
        through |= set(ids[depth > 0.5 * DEPTH / cells].tolist())
        deepest = max(deepest, float(depth.max()))
        if simulation.step_index % 10 == 0:
            level = left.measure(snapshot)["elevation"]
            series.append((simulation.time, budgets.volume(snapshot), level, x[:, 0].mean()))
    return {
        "series": np.array(series), "through": len(through), "removed": removed,
        "centres beyond a face": len(passed), "deepest [l0]": round(deepest * cells / DEPTH, 3),
        "particles": count, "steps": simulation.step_index,
    }  # fmt: skip


def drift(series: np.ndarray) -> float:
    """Return the change of the volume from the first to the last two periods, relative to the first."""
    t, volume = series[:, 0], series[:, 1]
    first, last = (volume[(t >= a * PERIOD) & (t < (a + 2) * PERIOD)].mean() for a in (0, PERIODS - 2))
    return float(last / first - 1.0)


def apart(one: np.ndarray, other: np.ndarray, column: int, until: float) -> float:
    """Return the rms difference of two series up to a time, over the standard deviation of the first."""
    t = np.linspace(0.0, until, 1000)
    a, b = (np.interp(t, s[:, 0], s[:, column]) for s in (one, other))
    return float(np.sqrt(np.mean((a - b) ** 2)) / np.std(a))


def main() -> None:
    """Run both frames at each resolution, print and save what was reached."""
    sizes = [int(a) for a in sys.argv[1:]] or [12]
    bars: list[Bar] = []
    notes: dict[str, object] = {"period [s]": round(PERIOD, 4)}
    figure, axes = plt.subplots(len(sizes), 1, figsize=(8, 3 * len(sizes)), layout="constrained", squeeze=False)
    for n, axis in zip(sizes, axes[:, 0], strict=True):
        found = {frame: run(frame, n) for frame in ("tank", "laboratory")}
        for frame, result in found.items():
            bars += [
                Bar(f"h/l0 = {n}, {frame}: particles through a wall or lost", 0, result["through"] + result["removed"]),
                Bar(f"h/l0 = {n}, {frame}: |drift of the volume|", 0.005, abs(drift(result["series"]))),
            ]
            notes[f"h/l0 = {n}, {frame}"] = {
                key: result[key]
                for key in ("particles", "steps", "through", "removed", "centres beyond a face", "deepest [l0]")
            } | {"drift": drift(result["series"])}
            axis.plot(result["series"][:, 0] / PERIOD, result["series"][:, 2], lw=0.9, label=f"frame: {frame}")
        one, other = (found[frame]["series"] for frame in ("tank", "laboratory"))
        notes[f"h/l0 = {n}, frames apart (rms / std)"] = {
            f"{periods} periods": {
                "centre of mass": round(apart(one, other, 3, periods * PERIOD), 4),
                "level": round(apart(one, other, 2, periods * PERIOD), 4),
            }
            for periods in (2, 4, PERIODS)
        }
        axis.set(xlabel="t / T", ylabel="level at x = 0.05 m [m]", title=f"h/l0 = {n}")
        axis.legend(frameon=False)
    title = "Rolling tank, ten periods at the default settings"
    show(title, bars, notes)
    save(HERE / "results.json", title, bars, notes)
    figure.savefig(HERE / "figure.png", dpi=110)


if __name__ == "__main__":
    main()
