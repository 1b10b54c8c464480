"""The files that a case names, kept in its run folder: drawings, tables of motion, measured data."""

from __future__ import annotations

import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from spume.named import CASES, Location, Parameters, walk

FOLDER = "inputs"
"""Folder of the copies, in the run folder."""

P = TypeVar("P", bound=Parameters)


def files_of(case: Parameters) -> list[Path]:
    """Return every file that parameters name, or what is inside them, in their order."""
    found: list[Path] = []

    def visit(parameters: Parameters, loc: Location) -> None:
        values = (getattr(parameters, name) for name in parameters.table_keys())
        found.extend(value for value in values if isinstance(value, Path))

    walk(case, visit)
    return found


def kept(case: P, folder: Path) -> P:
    """Copy the files that a case names into a run folder, and return the case that names the copies.

    A run can then be moved, sent and continued whatever becomes of the originals. Files that come with Spume stay where
    they are. Two files of one name are told apart by a number.

    Raises:
        OSError: a file cannot be copied.
    """
    copies: dict[Path, Path] = {}
    for source in files_of(case):
        if source in copies or source.is_relative_to(CASES):
            continue
        target, number = folder.absolute() / FOLDER / source.name, 2
        while target in copies.values():
            target, number = target.with_name(f"{source.stem}-{number}{source.suffix}"), number + 1
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy2(source, target)
        copies[source] = target
    return _renamed(case, copies) if copies else case


def _renamed(value: Any, names: Mapping[Path, Path]) -> Any:
    if isinstance(value, Path):
        return names.get(value, value)
    if isinstance(value, tuple):
        return tuple(_renamed(item, names) for item in value)
    if isinstance(value, Parameters):
        now = {name: getattr(value, name) for name in type(value).model_fields}
        new = {name: _renamed(item, names) for name, item in now.items()}
        changed = {name: item for name, item in new.items() if item is not now[name] and item != now[name]}
        return value.model_copy(update=changed) if changed else value
    return value
