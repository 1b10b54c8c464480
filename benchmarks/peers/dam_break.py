"""Speed and accuracy beside a peer: the 3D dam break of Lobovsky et al., one tank, one machine, one run.

    python benchmarks/peers/dam_break.py --peer-python PYTHON [--spacing 0.01] [--end 1.0] [--threads 2]
        [--set key=value ...] [--json FILE]

PYTHON is an interpreter that has pysplishsplash (its wheel bundles libGLdispatch, libGLX and libOpenGL; where the
import crashes, point those files to the system's libraries). Both codes write positions every 0.05 s, which one
function judges (judge.py); only the wall time of steps counts.
"""

import argparse
import json
import subprocess
import sys
import tempfile
import time
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE))

from judge import judge

INTERVAL, TANK = 0.05, (1.61, 0.15, 0.6)
PEER_SHARE = 0.8
"""A particle of SPlisHSPlasH stands for this part of its cube: its water packs closer than the lattice it starts on."""


def spume(spacing: float, end: float, threads: int, settings: list[str]) -> dict[str, Any]:
    """Run Spume; return frames and cost."""
    from spume import kernels
    from spume.build import build
    from spume.case import load

    case = load("dam-break-3d", [f"spacing={spacing!r}", f"time.end={end!r}", *settings])
    warm = build(case, threads=threads)
    for _ in range(3):  # compiles the kernels
        warm.advance()
    simulation = build(case, threads=threads)
    frames, wall, iterations = [], 0.0, []
    while not simulation.done:
        begin = time.perf_counter()
        simulation.advance()
        kernels.wait()
        wall += time.perf_counter() - begin
        iterations.append(simulation.statistics["iterations"])
        if simulation.time >= INTERVAL * (len(frames) + 1) - 1e-9:
            state = simulation.snapshot()
            frames.append(state["position"][state.fluid])
    return {
        "frames": frames,
        "wall": wall,
        "steps": simulation.step_index,
        "rows": simulation.particles.count,
        "iterations": float(np.mean(iterations)),
    }


def peer(python: str, spacing: float, end: float, threads: int) -> dict[str, Any]:
    """Run pySPlisHSPlasH; return frames and cost."""
    with tempfile.TemporaryDirectory() as scratch:
        out = Path(scratch) / "peer.npz"
        numbers = [str(v) for v in (spacing, end, INTERVAL, threads, out)]
        subprocess.run([python, str(HERE / "splishsplash.py"), *numbers], check=True, stdout=subprocess.DEVNULL)
        with np.load(out) as found:
            return {"frames": list(found["frames"]), "wall": float(found["wall"]), "steps": int(found["steps"])}


def figures(name: str, found: dict[str, Any], spacing: float, end: float) -> dict[str, Any]:
    """Return what one code reached; ``spacing`` is the cube root of the volume that one of its particles stands for."""
    fluid = len(found["frames"][0])
    verdict = judge(found["frames"], spacing, TANK)
    return {
        "code": name,
        "fluid": fluid,
        "steps": found["steps"],
        "wall": found["wall"],
        "simulated per wall second": end / found["wall"],
        "million particles x simulated per wall second": fluid * end / found["wall"] / 1e6,
        "us per fluid particle and step": found["wall"] / found["steps"] / fluid * 1e6,
        "mean dt": end / found["steps"],
        **asdict(verdict),
    }


def main() -> None:
    """Run both, print a table."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--peer-python", required=True)
    parser.add_argument("--spacing", type=float, default=0.01)
    parser.add_argument("--end", type=float, default=1.0)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--set", action="append", default=[], dest="settings")
    parser.add_argument("--json", type=Path)
    args = parser.parse_args()
    theirs = peer(args.peer_python, args.spacing, args.end, args.threads)
    ours = spume(args.spacing, args.end, args.threads, args.settings)
    rows = [
        figures("SPlisHSPlasH-DFSPH", theirs, PEER_SHARE ** (1 / 3) * args.spacing, args.end),
        figures("Spume", ours, args.spacing, args.end),
    ]
    for row in rows:
        print(
            f"{row['code']:20s} {row['fluid']:7d} fluid, {row['steps']:5d} steps, {row['wall']:7.1f} s: "
            f"{row['simulated per wall second']:.4f} simulated s per s, "
            f"{row['us per fluid particle and step']:.2f} us per fluid particle and step, "
            f"mean dt {1e3 * row['mean dt']:.2f} ms\n"
            f"{'':20s} |n - n0|/n0 {100 * row['error']:.2f} % (signed {100 * row['signed']:+.2f} %, "
            f"{row['judged']:.0f} rows a frame), volume {100 * row['volume']:+.2f} %, front at t = 0.3 s "
            f"{row['front'][min(5, len(row['front']) - 1)]:.3f} m"
        )
    key = "million particles x simulated per wall second"
    print(f"Spume over the peer, scaled by fluid particles: {rows[1][key] / rows[0][key]:.2f}")
    if args.json:
        args.json.write_text(
            json.dumps({"arguments": vars(args) | {"json": None}, "rows": rows}, indent=2, default=str)
        )


if __name__ == "__main__":
    main()
