"""Run folders without a solver, as files of a real run."""

import numpy as np

from outputs.fake_run import Simulation, complete, make_run
from spume.outputs import OutputSettings, Reference, outputs_of
from spume.outputs.gauges import Elevation, Energy, Volume

CASE = """\
title = "A tank"
spacing = 0.1
dimension = {dimension}

[time]
end = 0.5

[[fluid]]
name = "water"
shape = {{ kind = "box", lower = {lower}, upper = {filled} }}
density = 1000.0
viscosity = 1.0e-6

[[body]]
name = "tank"
kind = "wall"
shape = {{ kind = "tank", lower = {lower}, upper = {upper}, open = ["top"] }}

[[gauge]]
name = "level"
kind = "elevation"
at = {place}
interval = 0.02

[[gauge]]
name = "volume"
kind = "volume"

[[gauge]]
name = "energy"
kind = "energy"

[[reference]]
gauge = "level"
file = "level.csv"
lower = "low"
upper = "high"
label = "h [m]"
time_label = "t [s]"
source = "Nobody (1999)"

[output]
interval = 0.05
pictures = false
"""


def write_run(folder, width=None):
    """Make the folder of a run of 39 steps with 11 frames; 3D with a width."""
    folder.mkdir(parents=True)
    across = [] if width is None else [width]
    t = np.linspace(0.0, 0.5, 30)
    rows = np.column_stack([t, 0.5 + 0.1 * t, 0.45 + 0 * t, 0.55 + 0 * t])
    file = folder / "level.csv"
    file.write_text("t,h,low,high\n" + "\n".join(",".join(f"{v:.9g}" for v in row) for row in rows) + "\n")
    gauges = [
        Elevation(name="level", at=(0.5, *(w / 2 for w in across)), interval=0.02),
        Volume(name="volume"),
        Energy(name="energy"),
    ]
    reference = Reference(
        gauge="level", file=str(file), lower="low", upper="high", label="h [m]", source="Nobody (1999)"
    )
    settings = OutputSettings(interval=0.05, pictures=False)
    run = make_run(folder, gauges, [reference], settings, simulation=Simulation(width=width))
    text = CASE.format(
        dimension=2 + len(across), lower=[0.0, *(0.0 for _ in across), 0.0], filled=[1.0, *across, 0.5],
        upper=[1.0, *across, 1.0], place=[0.5, *(w / 2 for w in across)],
    )  # fmt: skip
    (folder / "case.toml").write_text(text)
    complete(run, outputs_of(run.case))
    return folder
