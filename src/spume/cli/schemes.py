"""spume schemes, spume schema: what may be selected, and what a case file may say."""

from __future__ import annotations

import json
from typing import Annotated

import typer

from spume.cli.app import answers, app, new_console
from spume.terminal import folding_table


@app.command()
@answers
def schemes(
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    family: Annotated[
        str | None, typer.Option(metavar="FAMILY", help="Only this family: gradient, laplacian, weight …")
    ] = None,
) -> None:
    """List the models: family, name, systems of the literature, source, order, what is conserved.

    Examples:
      spume schemes
      spume schemes --family gradient
      spume schemes --json
    """
    from spume import named

    named.load_all()
    chosen = [scheme for scheme in named.schemes() if family in (None, scheme.family)]
    if not chosen:
        known = sorted({scheme.family for scheme in named.schemes()})
        near = named.nearest_match(str(family), known)
        raise typer.BadParameter(f"{family!r}: one of {', '.join(known)}{near}", param_hint="--family")
    if as_json:
        rows = [
            {
                "family": scheme.family,
                "name": scheme.key,
                "ids": list(scheme.ids),
                "sources": list(scheme.publications()),
                "order": scheme.order,
                "conserves": sorted(scheme.conserves),
                "doc": (scheme.__doc__ or "").strip().split("\n")[0],
            }
            for scheme in chosen
        ]
        typer.echo(json.dumps(rows, indent=2, ensure_ascii=False))
        return
    table = folding_table("family", "name", "ids", "source", "order", "conserves")
    for scheme in chosen:
        order = "" if scheme.order is None else str(scheme.order)
        ids, conserves = " ".join(scheme.ids), ", ".join(sorted(scheme.conserves))
        sources = ", ".join(scheme.publications())
        table.add_row(scheme.family, scheme.key, ids, sources, order, conserves)
    new_console().print(table)


@app.command()
@answers
def schema() -> None:
    """Print the JSON Schema of case files, with which editors complete and check them.

    Example:
      spume schema > spume.schema.json
    """
    from spume.case import schema as case_schema

    typer.echo(json.dumps(case_schema(), indent=2, ensure_ascii=False))
