"""Writing so that nothing is lost: files that are whole or not there, and disks that are full."""

from __future__ import annotations

import errno
import os
import shutil
from pathlib import Path
from typing import Any

_RESERVE = 1 << 18  # for the summary and the last lines of tables [bytes]


class NotWritten(OSError):
    """Results cannot be written (a full disk, a quota, a file that is gone)."""


def synced(file: Any) -> int:
    """Bring what was written to a file to the disk; return the file's length [bytes]."""
    file.flush()
    os.fsync(file.fileno())
    return os.fstat(file.fileno()).st_size


def put_in_place(partial: Path, path: Path) -> None:
    """Give a file that is written and synced its name, in place of the one that has it now, in one go."""
    os.replace(partial, path)
    if os.name == "posix":  # the name is on the disk only with its folder
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


def replace_text(path: Path, text: str) -> None:
    """Write a text file, or leave the one that is there."""
    partial = path.with_name(path.name + ".partial")
    with partial.open("w", encoding="utf-8") as file:
        file.write(text)
        synced(file)
    put_in_place(partial, path)


def need_room(folder: Path, size: int) -> None:
    """Raise OSError where a disk has less than that many bytes left: better before a file is begun than in it."""
    free = shutil.disk_usage(folder).free
    if free < size + _RESERVE:
        raise OSError(errno.ENOSPC, f"{os.strerror(errno.ENOSPC)}: {size:,} bytes are needed, {free:,} are free")
