"""Tables of numbers in CSV files."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def read_csv(path: Path) -> tuple[list[str], NDArray[np.float64]]:
    """Return column names and numbers, shape (rows, columns), of a CSV file.

    Lines that are empty or start with ``#`` are skipped; the first other line names the columns,
    where a unit may follow in brackets or after a comma-free blank: ``time [s]``.

    Raises:
        ValueError: no numbers, a line of another length, something that is not a finite number; the
            message names the line.
    """
    names: list[str] = []
    rows: list[list[float]] = []
    try:
        with Path(path).open(newline="", encoding="utf-8-sig") as file:
            for line, cells in enumerate(csv.reader(file, strict=True), start=1):
                if not any(cell.strip() for cell in cells) or cells[0].lstrip().startswith("#"):
                    continue
                if not names:
                    names = [cell.strip() for cell in cells]
                    continue
                if len(cells) != len(names):
                    raise ValueError(f"{path}:{line}: {len(cells)} numbers under {len(names)} column names")
                try:
                    numbers = [float(cell) for cell in cells]
                except ValueError:
                    raise ValueError(f"{path}:{line}: {','.join(cells)}: numbers are allowed") from None
                if not np.all(np.isfinite(numbers)):
                    raise ValueError(f"{path}:{line}: {','.join(cells)}: finite numbers are allowed")
                rows.append(numbers)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path}: cannot be read as a CSV file: {error}") from None
    if not rows:
        raise ValueError(f"{path}: holds no numbers under a line of column names")
    return names, np.array(rows)


def line_of_row(path: Path, row: int) -> int:
    """Return the line of a CSV file on which a row of `read_csv`'s numbers stands, both counted from their first."""
    with Path(path).open(newline="", encoding="utf-8-sig") as file:
        lines = [
            line
            for line, cells in enumerate(csv.reader(file), start=1)
            if any(cell.strip() for cell in cells) and not cells[0].lstrip().startswith("#")
        ]
    return lines[row + 1]


def bare(name: str) -> str:
    """Return a column's name without its unit: ``time`` for ``time [s]``."""
    return name.split("[")[0].split("(")[0].strip().lower()
