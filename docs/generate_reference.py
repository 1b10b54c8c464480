"""Write docs/reference/case-file.md and command-line.md from the JSON Schema and from the command line itself.

    python docs/generate_reference.py           write the pages
    python docs/generate_reference.py --check   fail if a page is not what would be written

Needs an installed Spume.
"""

import inspect
import re
import sys
from pathlib import Path
from typing import Any, get_args, get_type_hints

DOCS = Path(__file__).resolve().parent
sys.path.insert(0, str(DOCS))

from keys import PAGES, cell, prose, publications, rows  # noqa: E402

import spume.case  # noqa: E402
from spume import presets  # noqa: E402
from spume.cli import app  # noqa: E402

HEADER = "<!-- Written by docs/generate_reference.py: change the code instead. -->"
UP = "../"

TABLES = (
    ("Time", "[time]"), ("Domain", "[domain]"), ("Fluid", "[[fluid]]"), ("family-body", "[[body]]"),
    ("family-step", "[step]"), ("family-gauge", "[[gauge]]"), ("Reference", "[[reference]]"),
    ("OutputSettings", "[output]"),
)  # fmt: skip
"""Tables of a case file, in the order of the page."""
CHOICES = (
    ("shape", "Shapes"), ("initial", "Initial fields"), ("gravity", "Gravity"), ("motion", "Motions"),
    ("wall_model", "Wall models"), ("solver", "Linear solvers"),
)  # fmt: skip
"""Families that have no page of their own."""

INTRODUCTION = """\
Every key of a case file: its type, unit, default, what is allowed, and what it means. `spume schema` prints the same as
a JSON Schema, with which editors complete and check case files; [Case files](../guide/cases.md) explains how a file is
read.

- **Units** are SI. The unit 1 is a plain number. Angles are in degrees where the key ends in `_deg`.
- **name or table**: a model is chosen by its name, `gradient = "corrected"`, or by a table with its parameters,
  `gradient = { name = "completed", largest_condition = 100.0 }`. Shapes, motions, gauges, bodies, initial fields and
  gravity say `kind` where models say `name`.
- A default of – means that the key may be left out; its meaning says what happens then.
- Numbers must be finite, and 0 or between 1e-100 and 1e18 in size. Unknown keys are refused."""


def case_file() -> str:
    """Return the page of case files."""
    schema = spume.case.schema()
    definitions = schema["$defs"]
    parts = [HEADER, "# Case file, key by key", INTRODUCTION, "## Top level { #top-level }", rows(schema, UP)]
    parts += ["## Presets { #presets }", PRESETS, presets_table()]
    for name, title in TABLES:
        definition = definitions[name]
        anchor = name.removeprefix("family-").lower()
        parts.append(f"## `{title}` {{ #{anchor} }}")
        if "properties" in definition:
            parts += [prose(definition.get("description", "")), rows(definition, UP)]
        else:
            parts += choices(anchor, definition)
    for family, title in CHOICES:
        parts.append(f"## {title} {{ #{family.replace('_', '-')} }}")
        parts += choices(family, definitions[f"family-{family}"])
    parts += [
        "## Models of a step",
        "Their parameters stand with their equations and claims, on the pages "
        + ", ".join(f"[{family}](../{page})" for family, page in sorted(PAGES.items()))
        + ".",
    ]
    missing = {name.removeprefix("family-") for name in definitions if name.startswith("family-")}
    missing -= set(PAGES) | {family for family, _ in CHOICES} | {name.removeprefix("family-") for name, _ in TABLES}
    if missing:
        raise SystemExit(f"families that no page describes: {', '.join(sorted(missing))}")
    return "\n\n".join(part for part in parts if part) + "\n"


PRESETS = """\
`preset = "NAME"` at the top level sets defaults of `step` and `time`; what the case says itself goes before them,
key by key. [Presets](../presets.md) says more."""


def presets_table() -> str:
    """Return the presets: what each is for, and what it sets."""
    lines = ["| preset | for | sets |", "|---|---|---|"]
    for name in presets.names():
        text = (presets.FOLDER / f"{name}.toml").read_text(encoding="utf-8")
        purpose = " ".join(line.removeprefix("#").strip() for line in text.splitlines() if line.startswith("#"))
        table = ""
        keys = []
        for line in text.splitlines():
            table = line.strip("[]") if line.startswith("[") else table
            keys += [f"`{table}.{line}`"] if "=" in line and not line.startswith("#") else []
        lines.append(f"| `{name}` | {cell(purpose)} | {', '.join(keys) or 'nothing'} |")
    return "\n".join(lines)


def choices(family: str, definition: dict[str, Any]) -> list[str]:
    """Return the sections of a family's models."""
    parts = [_SHORT.get(family, "")]
    for model in definition["anyOf"]:
        if "properties" in model:
            selector = next(key for key, node in model["properties"].items() if "const" in node)
            name = model["properties"][selector]["const"]
            parts.append(f"### `{name}` {{ #{family.replace('_', '-')}-{name} }}")
            parts += [prose(model.get("description", "")), rows(model, UP, frozenset({selector}))]
    return parts


_SHORT = {
    "gravity": "A bare vector stands for a constant one: `gravity = [0.0, -9.81]`.",
    "gauge": "What is measured: one table for each gauge, `kind` chooses among the following. Each writes "
    "`gauges/NAME.csv`, in whose header every column has its unit.",
    "body": "One table for each body; `kind` says what it is.",
    "step": "The algorithm of a time step, chosen by `name` (default `project-in-place`), and the models in its slots.",
    "shape": "A shape goes wherever a case file says `shape =`; [Geometry](../geometry.md) shows them.",
    "motion": "[Moving bodies and moving tanks](../motion.md) shows them.",
    "initial": "Velocity and pressure of a fluid at the start; several in a list are added up.",
}


# ------------------------------------------------------------------------------------------ command line


def command_line() -> str:
    """Return the page of the commands."""
    parts = [
        HEADER, "# Command line", described(app.info.help),
        "`spume COMMAND --help` prints the same. " + described(app.info.epilog),
        "## `spume`", options(app.registered_callback.callback),
    ]  # fmt: skip
    commands = {command.name or command.callback.__name__: command for command in app.registered_commands}
    for name, command in sorted(commands.items()):
        if command.hidden:
            continue
        words = ["spume", name, "[OPTIONS]", *(usage(*entry) for entry in entries(command.callback, "argument"))]
        parts += [f"## `spume {name}`", f"`{' '.join(words)}`"]
        parts += [described(command.help or command.callback.__doc__ or ""), options(command.callback)]
    return "\n\n".join(part for part in parts if part) + "\n"


def entries(callback: Any, kind: str) -> list[tuple[inspect.Parameter, Any, Any]]:
    """Return signature, type and typer's information of the arguments or of the options of a command."""
    hints = get_type_hints(callback, include_extras=True)
    found = []
    for parameter in inspect.signature(callback).parameters.values():
        hint, information = get_args(hints[parameter.name])[:2]
        if type(information).__name__ == f"{kind.capitalize()}Info":
            found.append((parameter, hint, information))
    return found


def label(parameter: inspect.Parameter, information: Any) -> str:
    """Return the name of an argument, as the help of its command shows it."""
    return re.sub(r"[\[\]….]", "", information.metavar or parameter.name.upper())


def usage(parameter: inspect.Parameter, hint: Any, information: Any) -> str:
    """Return how an argument stands in a command: in brackets if it may be left out, with dots if there may be more."""
    word = label(parameter, information) + ("..." if "list" in str(hint) else "")
    return word if parameter.default is inspect.Parameter.empty else f"[{word}]"


def options(callback: Any) -> str:
    """Return the table of a command's arguments and options."""
    lines = ["| argument or option | value | meaning |", "|---|---|---|"]
    for parameter, _, information in entries(callback, "argument"):
        name = label(parameter, information).replace("|", "\\|")
        lines.append(f"| `{name}` |  | {cell(unmarked(information.help or ''))} |")
    for parameter, hint, information in entries(callback, "option"):
        # In an annotation typer holds the first declaration as the default.
        declared = (information.default, *(information.param_decls or ()))
        names = [name for d in declared if isinstance(d, str) and d.startswith("-") for name in d.split("/")]
        word = parameter.name.replace("_", "-")
        names = names or ([f"--{word}", f"--no-{word}"] if hint is bool else [f"--{word}"])
        lines.append(
            f"| {', '.join(f'`{name}`' for name in names)} | {value(hint, information)} "
            f"| {cell(unmarked(information.help or ''))} |"
        )
    return "\n".join(lines) if len(lines) > 2 else ""


def value(hint: Any, information: Any) -> str:
    """Return what an option takes."""
    several = "list" in str(hint)
    types = [t for t in (*get_args(hint), hint) if t in _VALUES] or [
        t for part in get_args(hint) for t in get_args(part) if t in _VALUES
    ]
    word = information.metavar or _VALUES[types[0]]
    return (f"`{word}`" if word else "") + (" …" if several else "")


_VALUES = {str: "TEXT", int: "INTEGER", float: "NUMBER", Path: "PATH", bool: ""}


def described(text: str) -> str:
    """Return the help of a command as Markdown, its examples as code."""
    parts = []
    for paragraph in re.split(r"\n\s*\n", unmarked(inspect.cleandoc(text))):
        lines = [line.strip() for line in paragraph.splitlines()]
        found = [line for line in lines if line.startswith("spume ")]
        words = [line for line in lines if line not in found]
        parts += [prose(" ".join(words))] if words else []
        parts += ["\n".join(f"    {line}" for line in found)] if found else []
    return "\n\n".join(parts)


def unmarked(text: str) -> str:
    """Return a text of the command line without the marks for its colours."""
    return re.sub(r"\[/?(?:cyan|bold|dim|italic)\]", "", text).replace("\\[", "[")


# ------------------------------------------------------------------------------------------------ Python


def python() -> str:
    """Return the page of the public names; their docstrings are put in when the site is built."""
    names = [name for name in spume.__all__ if not name.startswith("_")]
    parts = [HEADER, "# Python", PYTHON]
    homes: dict[str, list[str]] = {}
    for name in names:
        homes.setdefault(spume._MODULE[name], []).append(name)
    for module, found in homes.items():
        parts.append(f"## {HOMES.get(module, module)}")
        for name in found:
            thing = getattr(spume, name)
            parts.append(f"::: {thing.__module__}.{thing.__qualname__}")
    parts += ["## What these return", *(f"::: {name}" for name in MADE)]
    return "\n\n".join(parts) + "\n"


PYTHON = """\
Everything that `import spume` offers. Names are imported when they are first used, so the import is quick. A case in
Python is what a case file says, as constructor calls: the keys are those of the [case file](case-file.md), with the
same units, defaults and limits. [Results from Python](../guide/python.md) shows how they work together."""
HOMES = {
    "spume.case": "Cases", "spume.geometry": "Shapes", "spume.bodies.wall": "Bodies", "spume.run": "Runs",
    "spume.simulation": "A simulation, step by step", "spume.history": "Gauges in memory", "spume.results": "Results",
    "spume.outputs": "Outputs and references", "spume.outputs.gauges": "Gauges", "spume.citation": "Citing",
}  # fmt: skip
MADE = ("spume.run.run", "spume.outputs.snapshot.Snapshot", "spume.outputs.vtkhdf.Frame")
"""What the names above return or stand for."""


# ----------------------------------------------------------------------------------------------- sources


def sources() -> str:
    """Return the page of all publications, in the order of their authors."""
    entries = sorted(publications().items(), key=lambda entry: entry[1].casefold())
    text = "What the models, cases and pages of this documentation cite. `spume cite RUN` prints the BibTeX of a run."
    return "\n\n".join([HEADER, "# Sources", text, "\n".join(f"- {line}" for _, line in entries)]) + "\n"


PAGES_HERE = {
    "case-file.md": case_file, "command-line.md": command_line, "python.md": python, "sources.md": sources,
}  # fmt: skip


def stale() -> list[str]:
    """Return the names of the pages that are not what would be written."""
    folder = DOCS / "reference"
    found = {path.name: path.read_text(encoding="utf-8") for path in folder.glob("*.md")}
    return [name for name, write in PAGES_HERE.items() if found.get(name) != write()]


def main() -> None:
    """Write the pages, or check them."""
    if "--check" in sys.argv:
        found = stale()
        if found:
            sys.exit(f"out of date: {', '.join(found)}; run python docs/generate_reference.py")
        return
    (DOCS / "reference").mkdir(exist_ok=True)
    for name, write in PAGES_HERE.items():
        (DOCS / "reference" / name).write_text(write(), encoding="utf-8")


if __name__ == "__main__":
    main()
