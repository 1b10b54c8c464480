"""Wall time from the command to the first step, with an empty and with a filled cache of compiled kernels.

    python benchmarks/start_up.py [--warm 5] [--cold 1]

Each start is a process of its own that does what ``spume run hydrostatic --set spacing=0.1 --set time.end=0.01`` does
and ends after the first step. Cold: an empty folder for SPUME_CACHE. Warm: the folder that a cold start filled.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path
from statistics import median

ARGUMENTS = ["run", "hydrostatic", "--set", "spacing=0.1", "--set", "time.end=0.01"]

STAGES = {
    "interpreter": "Python itself",
    "imports": "Spume and what it needs",
    "case": "command line, reading the case",
    "rows": "particles of the case",
    "set-up": "kernel language, tables on the device, output files",
    "first step": "compiling or loading kernels, and the step",
}

PROGRAM = """\
import json, sys, time
marks = [time.time()]
import spume.build, spume.run, spume.simulation
from spume.cli import main
marks.append(time.time())

def marking(function, before, after):
    def marked(*given, **named):
        if before:
            marks.append(time.time())
        result = function(*given, **named)
        if after:
            marks.append(time.time())
        return result
    return marked

def first_step(simulation):
    marks.append(time.time())
    plain(simulation)
    spume.kernels.wait()
    marks.append(time.time())
    print(json.dumps(marks), file=sys.stderr, flush=True)
    sys.exit()  # in good order: the kernel language writes its cache when it ends

plain = spume.simulation.Simulation.advance
spume.simulation.Simulation.advance = first_step
spume.build.initial_rows = marking(spume.build.initial_rows, True, True)
main()
"""


def start(cache: Path) -> list[float]:
    """Return the seconds of each stage of one start, with compiled kernels in a folder."""
    with tempfile.TemporaryDirectory() as folder:
        begin = time.time()
        answer = subprocess.run(
            [sys.executable, "-c", PROGRAM, *ARGUMENTS],
            cwd=folder,
            env=os.environ | {"SPUME_CACHE": str(cache)},
            capture_output=True,
            text=True,
            check=True,
        )
    marks = [begin, *json.loads(answer.stderr.splitlines()[-1])]
    return [after - before for before, after in pairwise(marks)]


def show(name: str, starts: list[list[float]]) -> None:
    """Print medians of the whole and of each stage, and the range of the whole."""
    totals = [sum(stages) for stages in starts]
    print(f"{name}: {median(totals):.2f} s to the first step done (median of {len(starts)}, ", end="")
    print(f"{min(totals):.2f} to {max(totals):.2f})")
    for number, (stage, what) in enumerate(STAGES.items()):
        print(f"  {stage:12s} {median(stages[number] for stages in starts):6.2f} s  {what}")


def main() -> None:
    """Start cold, then warm, and print where the time goes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--warm", type=int, default=5, help="starts with a filled cache")
    parser.add_argument("--cold", type=int, default=1, help="starts with an empty one")
    asked = parser.parse_args()
    starts = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(asked.cold):
            cache = Path(folder) / str(number)
            starts.append(start(cache))
        show("cold", starts)
        show("warm", [start(cache) for _ in range(asked.warm)])


if __name__ == "__main__":
    main()
