"""Tables of numbers in CSV files."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


def read_csv(path: Path, *, growing: bool = False) -> tuple[list[str], NDArray[np.float64]]:
    """Return column names and numbers, shape (rows, columns), of a CSV file.

    Lines that are empty or start with ``#`` are skipped; the first other line names the columns,
    where a unit may follow in brackets or after a comma-free blank: ``time [s]``.

    Args:
        path: the file.
        growing: the file is one that a run writes: it may hold no rows yet, values that are not there (NaN) and a
            last line that was cut short, which is passed over.

    Raises:
        ValueError: no numbers, a line of another length, something that is not a finite number; the
            message names the line.
    """
    records = list(_records(path))
    if len(records) < (1 if growing else 2):
        raise ValueError(f"{path}: holds no numbers under a line of column names")
    names = [cell.strip() for cell in records[0][1]]
    rows: list[list[float]] = []
    for index, (line, cells) in enumerate(records[1:], start=2):
        if len(cells) != len(names):
            if growing and index == len(records):
                break  # the writer was killed in the middle of it
            raise ValueError(f"{path}:{line}: {len(cells)} numbers under {len(names)} column names")
        try:
            numbers = [float(cell) for cell in cells]
        except ValueError:
            raise ValueError(f"{path}:{line}: {','.join(cells)}: numbers are allowed") from None
        if not growing and not np.all(np.isfinite(numbers)):
            raise ValueError(f"{path}:{line}: {','.join(cells)}: finite numbers are allowed")
        rows.append(numbers)
    return names, np.array(rows, dtype=float).reshape(len(rows), len(names))


def read_columns(path: Path) -> tuple[dict[str, NDArray[np.float64]], dict[str, str]]:
    """Return the columns, shape (rows,), and their units, by name, of a CSV file of a run or of a reference.

    Raises:
        ValueError: see `read_csv`.
    """
    titles, numbers = read_csv(path, growing=True)
    parts = [title.partition("[") for title in titles]
    names = [name.strip() for name, _, _ in parts]
    units = [unit.rstrip("] ").strip() for _, _, unit in parts]
    return dict(zip(names, numbers.T, strict=True)), dict(zip(names, units, strict=True))


def line_of_row(path: Path, row: int) -> int:
    """Return the line of a CSV file on which a row of `read_csv`'s numbers stands, both counted from their first."""
    return [line for line, _ in _records(path)][row + 1]


def _records(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield number and cells of each line that is neither empty nor a comment.

    Raises:
        ValueError: the file cannot be read.
    """
    try:
        with Path(path).open(newline="", encoding="utf-8-sig") as file:
            for number, line in enumerate(file, start=1):
                if line.lstrip().startswith("#"):
                    continue
                cells = next(csv.reader([line], strict=True), [])
                if any(cell.strip() for cell in cells):
                    yield number, cells
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path}: cannot be read as a CSV file: {error}") from None


def bare(name: str) -> str:
    """Return a column's name without its unit: ``time`` for ``time [s]``."""
    return name.split("[")[0].split("(")[0].strip().lower()
