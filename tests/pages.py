"""The code blocks of the documentation: where they are, what they are, and how a test runs them.

A page is read from top to bottom, as a reader would follow it, in a folder of its own:

- ``toml`` blocks with ``title="name"`` are written to that file. One that holds a whole case is checked as such; one
  that holds part of a case is merged into the whole one before it on the page, or into one of BASES, and checked.
- ``csv`` and other blocks with ``title="name"`` are written to that file.
- ``sh`` blocks are run line by line: ``spume …`` in this process, everything else by the shell.
- ``python`` blocks are executed, one after the other in one namespace; with a title they are written to that file.

So that this takes seconds, `spume run` gets the options of SHORT at its end, and so do runs that start from Python:
shorter, without pictures. With SPUME_DOCS_AS_PRINTED=1 in the environment ``pytest tests/test_pages.py`` runs
everything as printed, which takes a quarter of an hour.

An HTML comment before a block, which no reader sees, says what is different about it:

- ``<!-- not run: why -->``: its commands are only checked against the parser of the command line;
- ``<!-- exit code 2 -->``: its last command is to fail, with this code;
- ``<!-- short: --set spacing=0.05 -->``: options of the runs that follow on the page, besides SHORT;
- ``<!-- needs: meshio pyvista -->``: it is left out where these libraries of an extra are missing;
- ``<!-- no case: what it is -->``: a ``toml`` block that is no case file.
"""

import contextlib
import importlib.util
import io
import os
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import typer
from typer.testing import CliRunner

import spume
from spume.case import find_case
from spume.cli import app

ROOT = Path(__file__).parents[1]
SHORT = ("--set", "time.end=0.01", "--set", "output.pictures=false", "--set", "output.animation=none", "--threads", "1")


def _base(dimension: int) -> dict:
    """Return a tank with water, of the size that fragments think of."""
    water, tank, zero = [0.5, 0.5, 0.3], [2.0, 0.5, 0.6], [0.0] * dimension
    if dimension == 2:
        water, tank = [0.5, 0.3], [2.0, 0.6]
    return {
        "spacing": 0.05,
        "dimension": dimension,
        "time": {"end": 1.0},
        "fluid": [{"name": "water", "shape": {"kind": "box", "lower": zero, "upper": water}}],
        "body": [
            {
                "name": "tank",
                "kind": "wall",
                "shape": {"kind": "tank", "lower": zero, "upper": tank, "open": ["top"]},
            }
        ],
    }


BASES = (_base(2), _base(3))
"""Cases that a fragment may be part of."""

NOTES = {
    "python3 -m venv": ("not run", "installs packages"),
    "py -m venv": ("not run", "PowerShell"),
    "spume check column.toml": ("exit code", "2"),  # the run that is continued was not interrupted
    "import spume": ("not run", "tests/test_readme.py runs it"),
    'title = "A column of water that collapses"': ("title", "column.toml"),
}
"""Notes on blocks of the README, which is read where comments show, by how they begin."""

_BLOCK = re.compile(r"^(?P<indent> *)```(?P<info>[^`\n]*)\n(?P<text>.*?)^(?P=indent)```[ ]*$", re.MULTILINE | re.DOTALL)
_NOTE = re.compile(r"<!-- (not run|exit code|short|no case|title|needs):? ?(.*?) ?-->\s*\Z")


@dataclass(frozen=True)
class Block:
    """A fenced block: its page, line, language, file name, the notes before it, and its text."""

    page: Path
    line: int
    language: str
    title: str
    notes: dict[str, str]
    text: str

    def __str__(self) -> str:
        return f"{self.page.relative_to(ROOT).as_posix()}:{self.line}"


def pages() -> list[Path]:
    """Return every page of the documentation, and the README."""
    found = sorted((ROOT / "docs").rglob("*.md")) if (ROOT / "docs").exists() else []
    return [path for path in (ROOT / "README.md", *found) if path.exists()]


def blocks(page: Path) -> list[Block]:
    """Return the fenced blocks of a page, in their order."""
    text = page.read_text(encoding="utf-8")
    found = []
    for match in _BLOCK.finditer(text):
        indent, info = match["indent"], match["info"].strip()
        title = re.search(r'title="([^"]+)"', info)
        before, notes = text[: match.start()].rstrip(), {}
        while note := _NOTE.search(before):
            notes[note[1]] = note[2]
            before = before[: note.start()].rstrip()
        lines = [line.removeprefix(indent) for line in match["text"].splitlines()]
        line = text.count("\n", 0, match.start()) + 1
        notes |= [note for start, note in NOTES.items() if page.name == "README.md" and match["text"].startswith(start)]
        name = title[1] if title else notes.get("title", "")
        found.append(Block(page, line, info.split(" ")[0], name, notes, "\n".join(lines) + "\n"))
    return found


# ------------------------------------------------------------------------------------------------- toml


def merged(base: dict, part: dict) -> dict:
    """Return a document with a part put in: tables key by key, elements of arrays of tables by their name."""
    result = dict(base)
    for key, value in part.items():
        old = result.get(key)
        if isinstance(old, dict) and isinstance(value, dict):
            another = any(old.get(k, value[k]) != value[k] for k in ("kind", "name") if k in value)
            result[key] = value if another else merged(old, value)
        elif isinstance(old, list) and isinstance(value, list) and value and isinstance(value[0], dict):
            named = {item.get("name", id(item)): item for item in old}
            named.update({item.get("name", id(item)): item for item in value})
            result[key] = list(named.values())
        else:
            result[key] = value
    return result


def check_case(block: Block, whole: dict | None, folder: Path) -> dict | None:
    """Read a ``toml`` block as a case, or as a part of one; return the whole case, if it is one.

    Raises:
        CaseError: it is none.
    """
    from spume.problems import Origin

    document = tomllib.loads(block.text)
    if "spacing" in document and "fluid" in document:
        spume.case.read(document, Origin(str(block), document), folder=folder)
        return document
    candidates = BASES if whole is None else (whole,)
    errors = []
    for base in candidates:
        try:
            spume.case.read(merged(base, document), Origin(str(block), document), folder=folder)
            return whole
        except spume.CaseError as error:
            errors.append(error)
    raise min(errors, key=lambda error: len(error.problems))


# --------------------------------------------------------------------------------------------- commands


def commands(block: Block) -> Iterator[str]:
    """Yield the commands of a ``sh`` block: lines, joined where they end in a backslash, without comments."""
    for line in re.sub(r"[ ]*\\\n\s*", " ", block.text).splitlines():
        text = re.sub(r"(^|\s)#.*$", "", line).strip()
        if text:
            yield text


def spume_commands(block: Block) -> Iterator[list[str]]:
    """Yield the arguments of every use of ``spume`` in a block that is not run, shell constructs taken apart."""
    for text in commands(block):
        for part in re.split(r"&&|\|\||;|\bthen\b|\belse\b|\bdo\b", text):
            found = re.search(r"(?:^|[\s\\/])spume(?:\.sif)? (.*)$", part.strip().removeprefix("srun "))
            if found and not part.strip().startswith(("apptainer build", "pip ")):
                yield shlex.split(found[1].replace("\\", "/"))


def check_options(arguments: list[str]) -> None:
    """Let the parser of the command line judge a command without running it.

    Raises:
        Exception: an unknown command or option, or a missing argument, as typer says it.
    """
    group = typer.main.get_command(app)
    if arguments[0].startswith("-"):
        assert arguments[0] in ("--help", "--version", "--verbose", "-h", "-v"), f"no option {arguments[0]}"
        return
    name, *rest = arguments
    assert name in group.commands, f"no command {name!r}"
    if "--help" not in rest:
        group.commands[name].make_context(name, list(rest))


class Reader:
    """Follows a page in a folder: writes its files, runs its commands and its Python.

    Args:
        folder: where.
        as_printed: leave out the options that make runs short.
    """

    def __init__(self, folder: Path, as_printed: bool) -> None:
        self.folder, self.as_printed = folder, as_printed
        self.whole: dict | None = None
        self.names: dict = {"__name__": "__main__"}
        self.short: list[str] = []

    def follow(self, block: Block) -> None:
        """Do what a block says.

        Raises:
            AssertionError: a command did not end as it should.
        """
        if "short" in block.notes:
            self.short = shlex.split(block.notes["short"])
        if any(importlib.util.find_spec(name) is None for name in block.notes.get("needs", "").split()):
            return
        if block.title:
            (self.folder / block.title).write_text(block.text, encoding="utf-8")
        if "not run" in block.notes:
            assert block.notes["not run"], f"{block}: say why it is not run"
            for arguments in spume_commands(block):
                check_options(arguments)
        elif block.language == "toml" and "no case" not in block.notes:
            self.whole = check_case(block, self.whole, self.folder)
        elif block.language == "toml":
            tomllib.loads(block.text)
        elif block.language == "sh":
            self._shell(block)
        elif block.language == "python" and not block.title:
            with self._shortened():
                exec(compile(block.text, str(block), "exec"), self.names)

    def _shell(self, block: Block) -> None:
        found = list(commands(block))
        expected = int(block.notes.get("exit code", "0"))
        for index, text in enumerate(found):
            code, said = self._run(text)
            wanted = expected if index == len(found) - 1 else 0
            assert code == wanted, f"{block}: {text}\nended with {code}, not {wanted}\n{said}"

    def _run(self, text: str) -> tuple[int, str]:
        """Run a command; a loop over commands of Spume, or one whose output goes to a file, in this process too."""
        loop = re.fullmatch(r"for (\w+) in ([^;]+); do (spume [^;|<>&]+); done", text)
        if loop:
            each = [self._spume(loop[3].replace(f"${loop[1]}", word)) for word in loop[2].split()]
            return max(code for code, _ in each), "".join(said for _, said in each)
        written = re.fullmatch(r"(spume [^;|<>&]+) > ([\w.]+)", text)
        if written:
            code, said = self._spume(written[1])
            (self.folder / written[2]).write_text(said, encoding="utf-8")
            return code, said
        alone = text.startswith("spume ") and not re.search(r"[|<>;&]", text)
        return self._spume(text) if alone else self._other(text)

    def _spume(self, text: str) -> tuple[int, str]:
        arguments = shlex.split(text)[1:]
        if arguments[0] == "run" and not self.as_printed:
            arguments += [*self._options(), *SHORT[-2:]] if "--resume" not in arguments else []
        result = CliRunner().invoke(app, arguments)
        if result.exception is not None and not isinstance(result.exception, SystemExit):
            raise result.exception
        return result.exit_code, result.output

    def _other(self, text: str) -> tuple[int, str]:
        path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        done = subprocess.run(
            ["bash", "-c", text], cwd=self.folder, env={**os.environ, "PATH": path}, capture_output=True, text=True,
            timeout=600,
        )  # fmt: skip
        return done.returncode, done.stdout + done.stderr

    def _options(self) -> list[str]:
        return [*SHORT[:-2], *self.short]

    @contextlib.contextmanager
    def _shortened(self) -> Iterator[None]:
        """Let cases that run or are built in Python be short as well."""
        original = spume.Case.run, spume.Case.build
        settings = self._options()[1::2]

        def short(case: spume.Case) -> spume.Case:
            origin = find_case(case.origin.label)[0].parent if case.origin.label else self.folder
            document = case.table()
            problems = list(spume.case._apply(document, settings, {}))
            assert not problems, problems
            return spume.case.read(document, case.origin, folder=origin)

        def run(case: spume.Case, folder: str | None = None, **options: object) -> object:
            return original[0](short(case), folder, **{**options, "threads": 1})

        def build(case: spume.Case, *arguments: object, **options: object) -> object:
            return original[1](short(case), *arguments, **{**options, "threads": 1})

        if not self.as_printed:
            spume.Case.run, spume.Case.build = run, build
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                yield
        finally:
            spume.Case.run, spume.Case.build = original
