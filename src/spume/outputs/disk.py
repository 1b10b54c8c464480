"""Writing so that nothing is lost: files that are whole or not there, and disks that are full."""

from __future__ import annotations

import errno
import io
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
        said = f"{size:,} bytes and a reserve of {_RESERVE:,} for the last lines of tables are needed"
        raise OSError(errno.ENOSPC, f"{os.strerror(errno.ENOSPC)}: {said}, {free:,} are free")


class Sink(io.RawIOBase):
    """A file for h5py that keeps the first error of the disk for `check`.

    HDF5 that is told of an error can neither close its file any more nor let the process end in peace.

    Args:
        path: the file.
        new: make it, or empty it; else it is there.
    """

    def __init__(self, path: Path, new: bool = True) -> None:
        flags = os.O_RDWR | getattr(os, "O_BINARY", 0) | (os.O_CREAT | os.O_TRUNC if new else 0)
        self._descriptor = os.open(path, flags, 0o666)
        self._error: OSError | None = None

    def check(self) -> None:
        """Raise the first error of the disk; what was written after it is nowhere."""
        if self._error is not None:
            raise self._error

    def sync(self) -> None:
        """Bring what was written to the disk."""
        os.fsync(self._descriptor)

    def write(self, data: Any) -> int:
        """Write bytes; an error is kept for `check`, and everything counts as written."""
        view = memoryview(data).cast("B")
        written = 0
        try:
            while self._error is None and written < len(view):
                written += os.write(self._descriptor, view[written:])
        except OSError as error:
            self._error = error
        return len(view)

    def readinto(self, buffer: Any) -> int:
        """Fill a buffer from the file, with zeros after an error; return how many bytes were filled."""
        if self._error is not None:
            buffer[:] = bytes(len(buffer))
            return len(buffer)
        data = os.read(self._descriptor, len(buffer))
        buffer[: len(data)] = data
        return len(data)

    def seek(self, offset: int, whence: int = 0) -> int:
        return os.lseek(self._descriptor, offset, whence)

    def tell(self) -> int:
        return os.lseek(self._descriptor, 0, os.SEEK_CUR)

    def truncate(self, size: int | None = None) -> int:
        size = self.tell() if size is None else size
        try:
            if self._error is None:
                os.ftruncate(self._descriptor, size)
        except OSError as error:
            self._error = error
        return size

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def close(self) -> None:
        if not self.closed:
            os.close(self._descriptor)
        super().close()
