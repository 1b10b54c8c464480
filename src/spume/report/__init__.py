"""One HTML file that shows a run, or compares several, and needs nothing else: no network, no other file."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from spume.problems import CaseError, Problem
from spume.results import Results

__all__ = ["LARGEST_BYTES", "ReportError", "write_report"]

LARGEST_BYTES = 15_000_000
"""Size of a page at most; frames are left out where it would be larger, and the page says so."""

FILE = "report.html"
_FRAMES = 201  # shown at most, over all runs of a page
_FEWEST_FRAMES = 11

log = logging.getLogger("spume")


class ReportError(CaseError):
    """A report that cannot be made; the message says why and what to do."""

    def __init__(self, where: Path | str, message: str) -> None:
        super().__init__([Problem(str(where), "", "", message)])


def write_report(
    folders: str | os.PathLike[str] | Results | Sequence[str | os.PathLike[str] | Results],
    file: str | os.PathLike[str] | None = None,
) -> Path:
    """Write a self-contained HTML page of a run, or one that compares several; return its path.

    Args:
        folders: run folder, or several, or results that are open.
        file: the page; default: ``report.html`` in the run folder, ``report.html`` in the current folder for
            several. A report that is there is replaced; anything else is not.

    Raises:
        RunFolderError: a folder from which nothing can be read; the message says what it is.
        ReportError: plotly is missing, or the file is something else; the message gives the remedy.
    """
    single = isinstance(folders, str | os.PathLike | Results)
    given: Sequence[Any] = [folders] if single else folders  # type: ignore[assignment]
    runs = [item if isinstance(item, Results) else Results(item) for item in given]
    if not runs:
        raise ReportError("report", "names no run folder")
    library = _plotly()
    path = Path(file) if file is not None else (runs[0].path if len(runs) == 1 else Path.cwd()) / FILE
    _check_file(path)
    text = _page(runs, library)
    path.parent.mkdir(parents=True, exist_ok=True)
    from spume.outputs.disk import replace_text

    replace_text(path, text)
    return path


def _page(runs: Sequence[Results], library: str) -> str:
    from spume.report.page import page
    from spume.report.particles import packed, survey
    from spume.report.sample import LARGEST_COUNT

    labels = _labels(runs)
    count = LARGEST_COUNT // len(runs)
    frames = max(_FRAMES // len(runs), _FEWEST_FRAMES)
    seen = [_tried(run, survey, frames) if len(run) else None for run in runs]
    seen = [s if s is not None and len(s.frames) else None for s in seen]
    stride = 1
    while True:
        particles = []
        for run, overview in zip(runs, seen, strict=True):
            made = None if overview is None else _tried(run, packed, overview, count, stride)
            particles.append(None if made is None else (made[0], made[1].text()))
        text = page(runs, labels, seen, particles, library)
        size = len(text.encode("utf-8"))
        left = max((len(made[0]["frames"]) for made in particles if made is not None), default=0)
        if size <= LARGEST_BYTES or left <= _FEWEST_FRAMES:
            return text
        log.info("the page would have %.1f MB: every %d. frame is shown", size / 1e6, 2 * stride)
        stride *= 2


def _tried(run: Results, read: Callable[..., Any], *arguments: Any) -> Any:
    """Return what is read of a run's frames; None, with a note among its problems, where that is damaged."""
    try:
        return read(run, *arguments)
    except (OSError, KeyError, ValueError, RuntimeError) as error:
        run.problems.append(f"the particles cannot be shown: {' '.join(str(error).split())}")
        return None


def _labels(runs: Sequence[Results]) -> list[str]:
    """Return a name for each run: its folder's, with the folder's above where two are the same."""
    paths = [run.path.resolve() for run in runs]
    names = [path.name for path in paths]
    if len(set(names)) < len(names):
        names = [f"{path.parent.name}/{path.name}" for path in paths]
    return [n if names.count(n) == 1 else f"{n} ({i + 1})" for i, n in enumerate(names)]


def _check_file(path: Path) -> None:
    from spume.report.page import GENERATOR

    if path.is_dir():
        raise ReportError(path, f"a folder, not a file; name the page: --out {path / FILE}")
    if path.exists():
        with path.open("rb") as there:
            begin = there.read(400)
        if GENERATOR.encode() not in begin:
            raise ReportError(
                path, "exists and is no report of Spume; nothing is overwritten: choose another name (--out)"
            )


def _plotly() -> str:
    try:
        from plotly.offline import get_plotlyjs
    except ModuleNotFoundError:
        raise ReportError(
            "plotly", 'the charts of a report need plotly, which is not installed: pip install "spume[report]"'
        ) from None
    return str(get_plotlyjs())
