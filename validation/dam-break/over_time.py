"""How far the pressures of finished runs are off over time: the rows of the table in docs/presets.md.

    python validation/dam-break/over_time.py RUN ... [--largest-shift 0.1]

Prints for each run folder of the cases dam-break and gate the rms at z = 3, 15, 30, 80 mm over t sqrt(g/H) = 2.45 to
5.3 and the mean difference, in rho g H, against the full series where SPUME_REFERENCE_DATA names their folder, else
the table of the built-in case. To the case's own time shift --largest-shift adds the best one of at most that much.
"""

import argparse
from pathlib import Path

import numpy as np

from spume.validation import Curve, Folder
from spume.validation.cases.dam_break import HEIGHTS, WINDOW, pressure, reference
from spume.validation.study import mean_over_time, rms_over_time


def off(series: list[Curve], shift: float) -> list[tuple[float, float]]:
    """Return rms and mean difference of each sensor, shifted by as much."""
    pairs = [((t + shift, p), reference(k)) for k, (t, p) in enumerate(series, start=1)]
    return [(rms_over_time(*pair, WINDOW), mean_over_time(*pair, WINDOW)) for pair in pairs]


def main() -> None:
    """Print a line for each run."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("runs", nargs="+", type=Path)
    parser.add_argument("--largest-shift", type=float, default=0.0)
    args = parser.parse_args()
    shifts = np.arange(-args.largest_shift, args.largest_shift + 1e-9, 0.005) if args.largest_shift else [0.0]
    for run in args.runs:
        series = [pressure(Folder(run), k) for k in range(1, len(HEIGHTS) + 1)]
        best = min(shifts, key=lambda s: sum(rms**2 for rms, _ in off(series, s)))
        found = ", ".join(f"{rms:.3f} ({mean:+.3f})" for rms, mean in off(series, best))
        print(f"{run}: {found}, shifted by {best:.3f} beyond the case's own")


if __name__ == "__main__":
    main()
