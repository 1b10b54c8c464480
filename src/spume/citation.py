"""What to cite: BibTeX entries of Spume and of the publications behind the models that a case selects."""

from __future__ import annotations

import contextlib
import functools
import json
import os
import re
import unicodedata
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from spume.case import Case

REFERENCES = Path(__file__).with_name("references.bib")
"""The bibliography that the ``reference`` of every scheme is a key of."""

ALWAYS = ("koshizuka1996",)
"""Keys of what every run rests on: the method itself."""


@functools.cache
def bibliography() -> dict[str, str]:
    """Return every entry of the bibliography as BibTeX, by its key."""
    text = REFERENCES.read_text(encoding="utf-8")
    return {key: entry for entry, key in re.findall(r"^(@\w+\{([^,\s]+),.*?^\})", text, re.MULTILINE | re.DOTALL)}


def cite(run: Any, out: str | os.PathLike[str] | None = None) -> str:
    """Return what a publication that uses a run should cite, as BibTeX.

    The entries are that of Spume, of the version that computed the run; of the method (Koshizuka & Oka 1996); of
    every scheme that the case selects, also inside another scheme; and of the measurements that its gauges are
    compared with, where their ``source`` names an author and year of the bibliography. A comment before each
    entry says what it is the source of.

    Args:
        run: a run folder, a case file, the name of a built-in case, a `Case`, or anything with one as ``case``.
        out: file to write as well, ``*.bib``; one that exists is replaced.

    Raises:
        CaseError: no such case or run, or a case that cannot be read.
        OSError: `out` cannot be written.
    """
    case, version = _case(run)
    books = bibliography()
    used: dict[str, list[str]] = {key: ["the method"] for key in ALWAYS}
    for key, what in _sources(case):
        if key in books and what not in used.setdefault(key, []):
            used[key].append(what)
    entries = [_own(version), *(f"% {', '.join(what)}\n{books[key]}" for key, what in used.items())]
    text = "\n\n".join(entries) + "\n"
    if out is not None:
        Path(out).write_text(text, encoding="utf-8")
    return text


def _case(run: Any) -> tuple[Case, str]:
    """Return case and version of Spume."""
    import spume
    from spume.case import Case, CaseError, load
    from spume.problems import Problem

    case = run if isinstance(run, Case) else getattr(run, "case", None)
    folder = run if isinstance(run, str | os.PathLike) else getattr(run, "path", getattr(run, "folder", None))
    if not isinstance(case, Case):
        if not isinstance(run, str | os.PathLike):
            raise TypeError(f"{type(run).__name__}: a run folder, a case file, a built-in case or a Case is needed")
        if Path(run).is_dir() and not (Path(run) / "case.toml").is_file():
            raise CaseError([Problem(str(run), "", "", "no run folder: it holds no case.toml")])
        case = load(run)
    version = spume.__version__
    # Not run yet, or cut short: the version that reads it now.
    with contextlib.suppress(OSError, ValueError, KeyError):
        version = str(json.loads((Path(folder or "") / "summary.json").read_text(encoding="utf-8"))["version"])
    return case, version


def _own(version: str) -> str:
    return (
        f"% Spume itself\n@misc{{spume,\n"
        "  author = {{The Spume developers}},\n"
        "  title  = {Spume: Moving Particle Semi-implicit simulation for ocean and coastal engineering},\n"
        f"  note   = {{Version {version}, BSD 3-Clause licence}},\n"
        "}"
    )


def _sources(case: Case) -> Iterator[tuple[str, str]]:
    """Yield key of a publication, and what of the case comes from it."""
    from spume.named import Parameters, Scheme, walk

    found: list[tuple[str, str]] = []

    def visit(parameters: Parameters, _: Any) -> None:
        if isinstance(parameters, Scheme):
            what = f"{parameters.family.replace('_', ' ')} {parameters.key!r}"
            found.extend((key, what) for key in parameters.cited())

    walk(case, visit)
    yield from found
    for reference in case.reference:
        yield _key(reference.source), f"measured {reference.gauge}"


def _key(source: str) -> str:
    """Return the key that an author and year would have: ``lobovsky2014`` of ``Lobovský et al. (2014)``."""
    plain = unicodedata.normalize("NFKD", source).encode("ascii", "ignore").decode("ascii")
    parts = re.match(r"\s*([A-Za-z-]+).*?\b(\d{4}[a-z]?)\b", plain)
    return "" if parts is None else f"{parts[1].replace('-', '').lower()}{parts[2]}"
