"""Detections of the free surface on synthetic surfaces: rows missed and rows marked wrongly, counted.

python validation/surface-detection/check.py [--write]

With --write the table in docs/surface-detection.md is replaced by what was counted.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests"))

from spume import kernels
from spume.named import schemes
from spume.schemes import discover
from surfaces import SHAPES, errors, surface

PAGE = ROOT / "docs" / "surface-detection.md"
DISTURBANCES = (0.0, 0.1, 0.2, 0.3)
SEEDS = (1, 2)


def counts(scheme: object, d: int, disturbance: float) -> list[str]:
    """Return 'missed %/marked wrongly %' for every shape, over the random arrangements."""
    cells = []
    for shape in SHAPES:
        missed = wrong = on = off = 0
        for seed in SEEDS if disturbance else SEEDS[:1]:
            case = surface(shape, d, disturbance, seed)
            a, b = errors(scheme, case)
            missed, wrong, on, off = missed + a, wrong + b, on + case.on.sum(), off + case.off.sum()
        parts = [f"{100.0 * part / whole:.3g}" if whole else "–" for part, whole in ((missed, on), (wrong, off))]
        cells.append(" / ".join(parts))
    return cells


def main() -> None:
    """Print the tables; write them into the documentation where asked for."""
    discover()
    kernels.initialize("cpu", 1, "double")
    found = [kind() for kind in schemes("free_surface")]
    lines = []
    for d in (2, 3):
        for disturbance in DISTURBANCES:
            lines += [f"### {d}D, coordinates disturbed by up to {disturbance:g} l0", ""]
            lines += ["| scheme | " + " | ".join(SHAPES) + " |", "|---" * (len(SHAPES) + 1) + "|"]
            for scheme in found:
                lines.append(f"| `{scheme.key}` | " + " | ".join(counts(scheme, d, disturbance)) + " |")
                print(lines[-1] if len(lines) > 3 else "\n".join(lines), flush=True)
            lines.append("")
    text = "\n".join(lines)
    print(text)
    if "--write" in sys.argv:
        page = PAGE.read_text(encoding="utf-8")
        marks = r"(<!-- counts -->\n).*(<!-- end of counts -->)"
        PAGE.write_text(re.sub(marks, lambda m: f"{m[1]}\n{text}\n{m[2]}", page, flags=re.S), encoding="utf-8")


if __name__ == "__main__":
    main()
