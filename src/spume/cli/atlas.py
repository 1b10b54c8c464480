"""spume atlas: which models suit which problem."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spume.cli.app import answers, app, new_console


@app.command()
@answers
def atlas(
    only: Annotated[
        list[str] | None,
        typer.Option("--only", metavar="TEXT", help="Only combinations whose name contains this. May be repeated."),
    ] = None,
    listed: Annotated[bool, typer.Option("--list", help="List the combinations and problems; run nothing.")] = False,
    out: Annotated[Path, typer.Option(help="Folder of runs, tables and figure.")] = Path("atlas-runs"),
    report_only: Annotated[
        bool, typer.Option("--report", help="Run nothing: tables and figure of what has been run.")
    ] = False,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Runs side by side, one thread each. Default: one for each processor.")
    ] = None,
) -> None:
    """Run every model, one slot varied at a time, and published sets on six problems; what is done is not repeated.

    Examples:
      spume atlas --list
      spume atlas --only gradient --jobs 4
    """
    from spume.atlas.combinations import combinations
    from spume.atlas.problems import PROBLEMS
    from spume.named import nearest_match

    console = new_console()
    known = [combination.name for combination in combinations()]
    for text in only or []:
        if not any(text in name for name in known):
            message = f"{text!r} is part of no name: {', '.join(known)}{nearest_match(text, known)}"
            raise typer.BadParameter(message, param_hint="--only")
    chosen = [c for c in combinations() if not only or c.name == "default" or any(text in c.name for text in only)]
    if listed:
        for combination in chosen:
            console.print(f"{combination.name}: {', '.join(combination.settings) or 'as it is'}", highlight=False)
        console.print("Problems: " + ", ".join(f"{p.name} ({p.case}, {p.meaning})" for p in PROBLEMS), highlight=False)
        return
    from spume.atlas import driver, report
    from spume.kernels import available_threads

    def say(text: str) -> None:
        console.print(text, highlight=False)

    out.mkdir(parents=True, exist_ok=True)
    results = driver.compare(chosen, out, jobs=jobs or available_threads(), say=say, run=not report_only)
    report.write(results, out)
    say(f"Figure: {out / report.FIGURE}; tables: {out / report.PAGE}; numbers: {out / driver.RESULTS}")
