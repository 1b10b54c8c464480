"""Runs that are killed at random instants and continued: is one lost, does one bit differ?

python validation/kill/check.py [kills [seed]]

A small dam break is run once without interruption. Then it is run again and again, each time killed by SIGKILL at an
instant drawn evenly between its first checkpoint and its end (as long as it took the first time; a run that ends
before its instant is drawn again), and continued with ``spume run --resume``. The final states, gauges, log and frames
are compared with those of the first run, bit by bit.
"""

import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parent))

from bars import Bar, save, show

from spume.outputs import checkpoint, summary, vtkhdf

SPUME = [sys.executable, "-m", "spume.cli", "run"]


def start(folder: Path, *words: str) -> subprocess.Popen:
    """Start a run as a process of its own."""
    return subprocess.Popen([*SPUME, *words], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=folder.parent)


def started(folder: Path) -> float:
    """Wait for the first checkpoint of a run; return the instant."""
    while not (folder / checkpoint.FILE).exists():
        time.sleep(0.01)
    return time.monotonic()


def different_bits(one: Path, other: Path) -> int:
    """Return how many bits of the final states, the tables and the frames of two run folders differ."""
    a, b = checkpoint.read(one), checkpoint.read(other)
    pairs = [(np.asarray(a.arrays[n]), np.asarray(b.arrays[n])) for n in sorted({*a.arrays, *b.arrays})]
    pairs.append((np.array([a.time, a.step]), np.array([b.time, b.step])))
    with vtkhdf.Reader(one / "run.vtkhdf") as f, vtkhdf.Reader(other / "run.vtkhdf") as g:
        pairs.append((f.times, g.times))
        for k in range(min(len(f), len(g))):
            x, y = f.read(k), g.read(k)
            pairs += [(x[n], y[n]) for n in x.arrays]
    for table in ("log.csv", *(f"gauges/{p.name}" for p in (one / "gauges").glob("*.csv"))):
        pairs.append(tuple(np.frombuffer((d / table).read_bytes(), np.uint8) for d in (one, other)))
    total = 0
    for x, y in pairs:
        x, y = (np.frombuffer(np.ascontiguousarray(v).tobytes(), np.uint8) for v in (x, y))
        shared = min(len(x), len(y))
        total += int(np.unpackbits(x[:shared] ^ y[:shared]).sum()) + 8 * (max(len(x), len(y)) - shared)
    return total


def main() -> None:
    wanted = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    draw = random.Random(int(sys.argv[2]) if len(sys.argv) > 2 else 1)
    work = Path(tempfile.mkdtemp(prefix="spume-kill-"))
    case = str(HERE / "case.toml")
    whole = work / "whole"
    start(whole, case, "--out", "warm").wait()  # fills the cache of compiled kernels
    process = start(whole, case, "--out", "whole")
    begin = started(whole)
    assert process.wait() == 0
    duration = time.monotonic() - begin
    kills = lost = bits = late = 0
    while kills < wanted:
        folder = work / "killed"
        process = start(folder, case, "--out", folder.name)
        begin, instant = started(folder), draw.uniform(0.0, duration)
        try:
            process.wait(max(begin + instant - time.monotonic(), 0.0))
            late += 1
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            process.wait()
            kills += 1
            at = checkpoint.read(folder).time
            ended = summary.read(folder)["status"] == "finished"  # killed when nothing was left to do
            gone = not ended and start(folder, "--resume", folder.name).wait() != 0
            differing = 0 if gone else different_bits(whole, folder)
            lost, bits = lost + gone, bits + differing
            verdict = "LOST" if gone else f"{differing} bits differ"
            print(
                f"kill {kills:2d}, {instant:5.2f} s after the start: continued from t = {at:.3f} s, {verdict}",
                flush=True,
            )
        shutil.rmtree(folder)
    bars = [Bar("runs lost", 0, lost), Bar("bits different", 0, bits)]
    notes = {"kills": kills, "runs that ended before their instant": late, "steps": checkpoint.read(whole).step}
    show("Runs killed and continued", bars, notes)
    save(HERE / "results.json", "Runs killed and continued", bars, notes)
    shutil.rmtree(work)


if __name__ == "__main__":
    main()
