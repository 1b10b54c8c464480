"""Energy that splashes gain, which none may: the study behind the floor of the gradient ``imaged``.

    python validation/splashes/check.py

Twenty-five small 2D cases (columns that collapse against obstacles or alone, drops, jets and streams that meet), each
with some settings. Printed for each setting: by how much the mechanical energy of a run ever exceeds what it has been
before, over that of its start, mean and largest; what is left at the end; the largest speed. The table is written to
results.json.
"""

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import spume
from spume.particles import FLUID

HERE = Path(__file__).parent
G = 9.81
OBSTACLES = {
    "ramp": spume.Polygon(vertices=[(0.66, -0.1), (0.85, -0.1), (0.85, 0.064), (0.66, 0.0)]),
    "square on its edge": spume.Polygon(vertices=[(0.74, 0.171), (0.654, 0.06), (0.765, -0.026), (0.85, 0.086)]),
    "column": spume.Sphere(centre=[0.79, 0.0], radius=0.075),
    "box": spume.Box(lower=[0.7, -0.1], upper=[0.8, 0.08]),
}
SETTINGS = {
    "imaged, floor 0.3 (preset waves)": ("recommended", ["step.gradient={name='imaged',floor=0.3}"]),
    "imaged, floor 0.45 (default)": ("recommended", []),
    "imaged, floor 0.6": ("recommended", ["step.gradient={name='imaged',floor=0.6}"]),
    "imaged, floor 0.8": ("recommended", ["step.gradient={name='imaged',floor=0.8}"]),
    "stabilised": ("recommended", ["step.gradient=stabilised"]),
    "preset violent": ("violent", []),
}
"""Preset, and keys that replace what it says."""


def cases(preset: str) -> Iterator[tuple[str, spume.Case]]:
    """Yield names and cases."""
    wide = spume.Wall(name="tank", shape=spume.Tank(lower=[0.0, 0.0], upper=[1.2, 0.9], open=["top"]))
    narrow = spume.Wall(name="tank", shape=spume.Tank(lower=[0.0, 0.0], upper=[0.6, 0.8], open=["top"]))

    def case(spacing: float, end: float, bodies: list[spume.Wall], *water: tuple[object, list[float]]) -> spume.Case:
        fluid = [
            spume.Fluid(name=f"water{k}", shape=shape, initial={"kind": "uniform", "value": speed})
            for k, (shape, speed) in enumerate(water)
        ]
        return spume.Case(preset=preset, spacing=spacing, time=spume.Time(end=end), fluid=fluid, body=bodies)

    still = [0.0, 0.0]
    for width, spacing in ((0.2, 0.025), (0.2, 0.01875), (0.3, 0.0125)):
        column = spume.Box(lower=[0.0, 0.0], upper=[width, 0.3])
        for name, shape in OBSTACLES.items():
            bodies = [wide, spume.Wall(name="obstacle", shape=shape)]
            yield f"column against {name}, {spacing:g}", case(spacing, 0.75, bodies, (column, still))
        yield f"column, {spacing:g}", case(spacing, 0.9, [wide], (column, still))
    for spacing in (0.01875, 0.0125, 0.01):
        free = spume.Box(lower=[0.2, 0.0], upper=[0.4, 0.4])
        yield f"column in the middle, {spacing:g}", case(spacing, 0.45, [narrow], (free, still))
        drop = spume.Sphere(centre=[0.3, 0.15], radius=0.09)
        yield f"drop, {spacing:g}", case(spacing, 0.42, [narrow], (drop, [0.0, -3.83]))
        jet = spume.Box(lower=[0.05, 0.2], upper=[0.45, 0.3])
        yield f"jet, {spacing:g}", case(spacing, 0.4, [narrow], (jet, [4.0, 0.0]))
    yield (
        "streams that meet, 0.0125",
        case(
            0.0125, 0.45, [narrow],
            (spume.Box(lower=[0.0125, 0.2], upper=[0.25, 0.3]), [3.0, 0.0]),
            (spume.Box(lower=[0.35, 0.2], upper=[0.55, 0.3]), [-3.0, 0.0]),
        ),
    )  # fmt: skip


def run(case: spume.Case, settings: list[str], folder: Path, device: str = "cpu") -> tuple[float, float, float]:
    """Return by how much the energy rises, what is left of it, and the largest speed [m/s]."""
    file = folder / "case.toml"
    file.write_text(case.to_toml())
    simulation = spume.load(file, settings).build(device=device, threads=1)

    def state() -> tuple[float, float]:
        x, u, kind = (simulation.fetch(name) for name in ("position", "velocity", "kind"))
        fluid = kind == FLUID
        squares = (u[fluid] ** 2).sum(axis=1)
        return float((0.5 * squares + G * x[fluid, 1]).sum()), float(np.sqrt(squares.max()))

    first, fastest = state()
    least, risen, now = first, 0.0, first
    while not simulation.done:
        simulation.advance()
        now, speed = state()
        least, risen, fastest = min(least, now), max(risen, now - least), max(fastest, speed)
    return risen / first, now / first, fastest


def main() -> None:
    """Run every case with every setting."""
    import logging
    import tempfile

    logging.getLogger("spume").setLevel(logging.ERROR)
    results: dict[str, dict[str, list[float]]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for setting, (preset, keys) in SETTINGS.items():
            rows = results[setting] = {name: list(run(case, keys, Path(folder))) for name, case in cases(preset)}
            values = np.array(list(rows.values()))
            print(
                f"{setting:34} energy rises by {values[:, 0].mean():.4f} (largest {values[:, 0].max():.4f}), "
                f"{values[:, 1].mean():.3f} is left, fastest {values[:, 2].mean():.2f} m/s",
                flush=True,
            )
    (HERE / "results.json").write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    main()
