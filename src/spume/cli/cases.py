"""spume cases, spume new: where a case comes from."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from spume.cli.app import answers, app, complete_case, new_console
from spume.terminal import folding_table


@app.command()
@answers
def cases() -> None:
    """List the built-in cases, with which spume run, check, new --from and cite work.

    Example:
      spume cases
    """
    import tomllib

    from spume.named import CASES

    table = folding_table("name", "title")
    for path in sorted(CASES.glob("*/case.toml")):
        with path.open("rb") as file:
            table.add_row(path.parent.name, tomllib.load(file).get("title", ""))
    console = new_console()
    console.print(table)
    console.print("Run one with: spume run NAME", highlight=False)


@app.command()
@answers
def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the case; the file is NAME.toml.")],
    source: Annotated[
        str | None,
        typer.Option(
            "--from",
            metavar="CASE",
            help="Case to start from: a case file, or the name of a built-in case.",
            autocompletion=complete_case,
        ),
    ] = None,
) -> None:
    """Write a commented case file to start from.

    Examples:
      spume new my-tank
      spume new my-sloshing --from sloshing
    """
    from spume.named import CASES

    path = Path(f"{name.removesuffix('.toml')}.toml")
    if not re.fullmatch(r"[^\s/\\.][^\s/\\]*", name.removesuffix(".toml")):
        raise typer.BadParameter(f"{name!r}: a file name without blanks or folders is allowed", param_hint="NAME")
    if path.exists():
        raise FileExistsError(f"{path} exists already; nothing is overwritten: choose another name")
    if source is None:
        text = (CASES / "template.toml").read_text(encoding="utf-8").format(name=path.stem)
    else:
        from spume.case import find_case

        origin, _ = find_case(source)
        text = origin.read_text(encoding="utf-8")
    path.write_text(text, encoding="utf-8")
    new_console().print(f"Wrote {path}. Look at it, then: spume check {path}", highlight=False)
