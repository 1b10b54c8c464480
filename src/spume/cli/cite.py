"""spume cite: what a publication should cite."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spume.cli.app import answers, app, complete_case, new_console


@app.command()
@answers
def cite(
    run: Annotated[
        str,
        typer.Argument(
            metavar="RUN|CASE",
            help="A run folder, a case file, or the name of a built-in case (spume cases).",
            autocompletion=complete_case,
        ),
    ],
    out: Annotated[Path | None, typer.Option(help="BibTeX file to write. Default: the terminal.")] = None,
) -> None:
    """Print BibTeX of Spume and of the sources of every model that a run used.

    Measurements that gauges are compared with are cited as well, where their publication is known.

    Examples:
      spume cite dam-break
      spume cite my-run --out references.bib
    """
    from spume.citation import cite as entries

    text = entries(run, out)
    if out is None:
        typer.echo(text, nl=False)
    else:
        new_console().print(f"Wrote {text.count(chr(10) + '@')} entries to {out}", highlight=False)
