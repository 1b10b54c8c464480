"""What every validation script shares: the table of bars, the record of the machine, the figure's style."""

import json
import platform
from dataclasses import asdict, dataclass
from datetime import date
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Bar:
    """One number to reach, and what was reached.

    Attributes:
        quantity: what is measured.
        bar: upper limit, or (lower, upper).
        reached: the measured value.
    """

    quantity: str
    bar: float | tuple[float, float]
    reached: float

    @property
    def holds(self) -> bool:
        """Whether the bar holds."""
        low, high = self.bar if isinstance(self.bar, tuple) else (float("-inf"), self.bar)
        return low <= self.reached <= high


def show(title: str, bars: list[Bar], notes: dict[str, Any]) -> None:
    """Print the bars as a table, missed ones as missed."""
    print(f"\n{title}")
    for bar in bars:
        verdict = "holds" if bar.holds else "MISSED"
        print(f"  {bar.quantity:52s} bar {bar.bar!s:>18}  reached {bar.reached:10.4g}  {verdict}")
    for key, value in notes.items():
        print(f"  {key}: {value}")


def save(path: Path, title: str, bars: list[Bar], notes: dict[str, Any]) -> None:
    """Write bars and notes as JSON, with date and machine."""
    record = {
        "title": title,
        "date": date.today().isoformat(),
        "machine": f"{platform.machine()} {platform.system()}, Python {platform.python_version()}",
        "bars": [{**asdict(bar), "holds": bar.holds} for bar in bars],
        "notes": notes,
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(record, indent=2, default=float) + "\n", encoding="utf-8")
