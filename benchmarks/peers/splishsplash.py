"""The dam break in pySPlisHSPlasH (DFSPH): run by its own interpreter, called by dam_break.py.

    python splishsplash.py SPACING END INTERVAL THREADS OUT.npz

Writes the positions of the fluid at multiples of INTERVAL, the wall time of the steps and their number.
"""

import json
import os
import sys
import tempfile
import time
from pathlib import Path

spacing, end, interval = (float(a) for a in sys.argv[1:4])
os.environ["OMP_NUM_THREADS"] = sys.argv[4]

import numpy as np
import pysplishsplash as sph

TANK, COLUMN = (1.61, 0.15, 0.6), (0.6, 0.15, 0.3)

# The room, as a box of unit size around the origin whose faces look inwards.
BOX = """v -0.5 -0.5 -0.5
v 0.5 -0.5 -0.5
v 0.5 0.5 -0.5
v -0.5 0.5 -0.5
v -0.5 -0.5 0.5
v 0.5 -0.5 0.5
v 0.5 0.5 0.5
v -0.5 0.5 0.5
f 1 3 2
f 1 4 3
f 5 6 7
f 5 7 8
f 1 2 6
f 1 6 5
f 3 4 8
f 3 8 7
f 1 5 8
f 1 8 4
f 2 3 7
f 2 7 6
"""


def scene(folder: Path) -> Path:
    """Write the scene; the fluid starts two particle diameters from the walls, or it bursts."""
    (folder / "box.obj").write_text(BOX)
    gap = 2.0 * spacing
    low = [gap, gap, gap]
    high = [COLUMN[0], COLUMN[1] - gap, COLUMN[2]]
    description = {
        "Configuration": {
            "particleRadius": spacing / 2,
            "numberOfStepsPerRenderUpdate": 1,
            "density0": 1000,
            "simulationMethod": 4,  # DFSPH
            "gravitation": [0, 0, -9.81],
            "cflMethod": 1,
            "cflFactor": 1,
            "cflMaxTimeStepSize": 0.005,
            "boundaryHandlingMethod": 0,
            "DFSPH": {
                "maxIterations": 100,
                "maxError": 0.05,
                "maxIterationsV": 100,
                "maxErrorV": 0.1,
                "enableDivergenceSolver": True,
            },
        },
        "Materials": [{"id": "Fluid", "viscosityMethod": 1, "Viscosity_Standard": {"viscosity": 0.001}}],
        "RigidBodies": [
            {
                "geometryFile": str(folder / "box.obj"),
                "translation": [TANK[0] / 2, TANK[1] / 2, TANK[2] / 2],
                "rotationAxis": [1, 0, 0],
                "rotationAngle": 0,
                "scale": list(TANK),
                "isDynamic": False,
                "isWall": True,
                "color": [0.1, 0.4, 0.6, 1.0],
                "mapInvert": True,
                "mapThickness": 0.0,
                "mapResolution": [20, 20, 20],
                "samplingMode": 1,
            }
        ],
        "FluidBlocks": [{"denseMode": 0, "start": low, "end": high, "translation": [0, 0, 0], "scale": [1, 1, 1]}],
    }
    path = folder / "scene.json"
    path.write_text(json.dumps(description))
    return path


def main() -> None:
    """Run to the end; save positions and times."""
    with tempfile.TemporaryDirectory() as scratch:
        base = sph.Exec.SimulatorBase()
        base.init(sceneFile=str(scene(Path(scratch))), useGui=False, initialPause=False, outputDir=scratch)
        base.initSimulation()
        fluid = sph.Simulation.getCurrent().getFluidModel(0)
        clock = sph.TimeManager.getCurrent()
        frames, times, stamps = [], [], []
        watching = 0.0

        def after_step() -> None:
            nonlocal watching
            begin = time.perf_counter()
            stamps.append(begin - watching)
            if clock.getTime() >= interval * (len(frames) + 1) - 1e-9:
                n = fluid.numActiveParticles()
                frames.append(np.array([fluid.getPosition(i) for i in range(n)]))
                times.append(clock.getTime())
            watching += time.perf_counter() - begin

        base.setTimeStepCB(after_step)
        base.setValueFloat(base.STOP_AT, end)
        base.runSimulation()
        steps, wall = len(stamps) - 1, stamps[-1] - stamps[0]
        np.savez(sys.argv[5], frames=np.array(frames), times=times, wall=wall, steps=steps)


if __name__ == "__main__":
    main()
