"""spume new-scheme: a working model to start from, and its entry among the claims."""

from __future__ import annotations

import ast
import inspect
import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from spume.cli.app import answers, app, new_console

if TYPE_CHECKING:
    from spume.named import Scheme

_FIRST = ("original", "inverse", "density", "number-density", "none", "fickian", "explicit")
"""Schemes to start from, the plainest of their families."""


@app.command("new-scheme")
@answers
def new_scheme(
    family: Annotated[str, typer.Argument(metavar="FAMILY", help="A family of models: gradient, laplacian, weight …")],
    name: Annotated[str, typer.Argument(metavar="NAME", help="The new model's name, as case files will write it.")],
    source: Annotated[
        str | None, typer.Option("--from", metavar="SCHEME", help="Model of the family to start from.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="File to write, for a package of your own. Default: in the family's folder.")
    ] = None,
) -> None:
    """Write a model that works: a copy of the plainest of its family, to be changed, and its claims entry.

    Examples:
      spume new-scheme gradient my-gradient
      spume new-scheme weight my-weight --from wendland --out my_weight.py
    """
    from spume import named

    named.load_all()
    model = _model(family, source)
    _free(family, name)
    folder = Path(inspect.getfile(model)).parent
    claims = _claims(folder)
    if out is None and claims is None:
        raise typer.BadParameter("this installation is no clone of Spume: name the file with --out", param_hint="--out")
    path = out or folder / f"{name.replace('-', '_')}.py"
    if path.exists():
        raise FileExistsError(f"{path} exists already; nothing is overwritten: choose another name, or --out")
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(skeleton(Path(inspect.getfile(model)).read_text(encoding="utf-8"), model, name), encoding="utf-8")
    console = new_console()
    console.print(f"Wrote {path}: it works, and computes what {family} {model.key!r} does.", highlight=False)
    if out is None and claims is not None:
        text = claims.read_text(encoding="utf-8")
        claims.write_text(f"{text.rstrip()}\n\n{claims_entry(text, model, name)}", encoding="utf-8")
        console.print(f"Wrote its entry at the end of {claims}: change both, then", highlight=False)
        console.print(f"  pytest tests/test_claims.py -k {family}.{name}", highlight=False)
        return
    console.print("Announce it in the pyproject.toml of its package, and install that:", highlight=False)
    console.print(f'  [project.entry-points."spume.schemes"]\n  {path.stem} = "YOUR_PACKAGE.{path.stem}"', markup=False)


def _model(family: str, source: str | None) -> type[Scheme]:
    from spume import named

    known = [s for s in named.schemes() if s.__module__.startswith("spume.schemes.")]
    families = sorted({s.family for s in known})
    if family not in families:
        near = named.nearest_match(family, families)
        raise typer.BadParameter(f"{family!r}: one of {', '.join(families)}{near}", param_hint="FAMILY")
    models = {s.key: s for s in known if s.family == family}
    if source is None:
        source = next((key for key in _FIRST if key in models), next(iter(models)))
    if source not in models:
        near = named.nearest_match(source, models)
        raise typer.BadParameter(f"{source!r}: one of {', '.join(models)}{near}", param_hint="--from")
    return models[source]


def _free(family: str, name: str) -> None:
    from spume import named

    if not re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", name):
        allowed = "small letters, digits and single hyphens, a letter first: higher-order"
        raise typer.BadParameter(f"{name!r}: {allowed}", param_hint="NAME")
    if name in {s.key for s in named.schemes(family)}:
        raise typer.BadParameter(f"{name!r}: there is a {family} of that name already", param_hint="NAME")


def _claims(folder: Path) -> Path | None:
    """Return the claims of the clone that a family's folder lies in, if it does."""
    path = folder.parents[3] / "tests" / "claims.toml"
    return path if path.is_file() else None


def skeleton(text: str, model: type[Scheme], name: str) -> str:
    """Return the text of a module with one scheme only, renamed, without ids and without a publication."""
    new_class = "".join(part.capitalize() for part in name.split("-"))
    lines = text.splitlines(keepends=True)
    tree = ast.parse(text)
    edits: list[tuple[int, int, str]] = []  # first line, last line (counted from 1), new text
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and node.name == model.__name__:
            base = ", ".join(ast.unparse(part) for part in node.bases)
            edits.append((node.lineno, node.lineno, f'class {new_class}({base}, name="{name}"):\n'))
            edits += _claims_of_class(node, model)
        elif isinstance(node, ast.ClassDef) and any(keyword.arg == "name" for keyword in node.keywords):
            edits.append((node.lineno, node.end_lineno or node.lineno, ""))
    first = tree.body[0]
    edits.append((first.lineno, first.end_lineno or first.lineno, f'"""One sentence: what the {name} model is."""\n'))
    for begin, end, new in sorted(edits, reverse=True):
        lines[begin - 1 : end] = [new] if new else []
    return re.sub(r"\n{4,}", "\n\n\n", "".join(lines)).rstrip() + "\n"


def _claims_of_class(node: ast.ClassDef, model: type[Scheme]) -> list[tuple[int, int, str]]:
    """Return the edits of a class: a docstring to fill in, nothing claimed that the copy has not shown."""
    edits = []
    for statement in node.body:
        span = (statement.lineno, statement.end_lineno or statement.lineno)
        if isinstance(statement, ast.Expr) and statement is node.body[0]:
            edits.append((*span, _DOCSTRING.format(key=model.key)))
        target = getattr(statement, "target", None)
        if isinstance(target, ast.Name) and target.id == "ids":
            edits.append((*span, ""))
        if isinstance(target, ast.Name) and target.id == "reference":
            keys = [f'"{key}"' for key in model.publications()]
            value = keys[0] if len(keys) == 1 else f"({', '.join(keys)})"
            edits.append((*span, f"    reference: ClassVar = {value}  # its own key in src/spume/references.bib\n"))
    return edits


_DOCSTRING = '''    """The equation (author year; its number there).

    What it conserves and which polynomials it reproduces; when to prefer it. (Still the formula of {key!r}.)
    """
'''


def claims_entry(text: str, model: type[Scheme], name: str) -> str:
    """Return an entry of claims.toml for a copy of a scheme; the double loop stays that of the original."""
    header = re.search(rf"^\[{model.family}\.{re.escape(model.key)}\]\n", text, re.MULTILINE)
    if header is None:
        return f"[{model.family}.{name}]\nids = []\n"
    rest = text[header.end() :]
    following = re.search(r"^\[", rest, re.MULTILINE)
    body = rest[: following.start()] if following else rest
    body = re.sub(r"^ids = .*\n", "ids = []\n", body, flags=re.MULTILINE).rstrip()
    if "loop = " not in body and "function = " not in body:
        body = body.replace("value = {", f'value = {{ function = "{model.key}",').replace(
            "value = [{", f'value = [{{ function = "{model.key}",'
        )
    return f"[{model.family}.{name}]\n{body}\n"
