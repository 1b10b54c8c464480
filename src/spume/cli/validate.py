"""spume validate: the validation cases, with the bars beside what is reached."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from spume.cli.app import DIVERGED, answers, app, new_console
from spume.terminal import folding_table

if TYPE_CHECKING:
    from rich.table import Table

MISSED = 5


@app.command()
@answers
def validate(
    cases: Annotated[
        list[str] | None, typer.Argument(metavar="[CASE]...", help="Names or numbers of cases. Default: all.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Coarse runs, with limits of their own: minutes.")] = False,
    listed: Annotated[bool, typer.Option("--list", help="List the cases and their bars; run nothing.")] = False,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder of runs and report. Default: validation-runs, with --quick validation-quick."),
    ] = None,
    report_only: Annotated[
        bool, typer.Option("--report", help="Run nothing: judge and report what has been run.")
    ] = False,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Runs side by side, one thread each. Default: one for each processor.")
    ] = None,
) -> None:
    """Run validation cases, compare them with their references and print the bars; finished runs are not repeated.

    Exit code 5: a bar is missed.

    Examples:
      spume validate --list
      spume validate hydrostatic --quick
    """
    from spume.validation.study import chosen

    console = new_console()
    studies = chosen(cases or [])
    if listed:
        table = folding_table("number", "name", "case", "runs")
        for study in studies:
            table.add_row(study.number, study.name, study.title, ", ".join(run.name for run in study.runs))
        console.print(table)
        return
    from spume.kernels import available_threads
    from spume.validation import driver, report

    folder = out or Path("validation-quick" if quick else "validation-runs")
    folder.mkdir(parents=True, exist_ok=True)

    def say(text: str) -> None:
        console.print(text, highlight=False)

    results = driver.validate(
        studies, folder, quick=quick, jobs=jobs or available_threads(), say=say, run=not report_only
    )
    console.print(table_of(results))
    say(f"Report: {folder / report.REPORT}")
    failed = [run for study in results for run in study["runs"] if run["status"] not in ("finished", "not run")]
    for run in failed:
        say(f"{run['case']}, {run['name']} {run['status']}: {run['reason']}")
    if failed:
        raise typer.Exit(DIVERGED)
    if any(bar["verdict"] == "MISSED" for study in results for bar in study["bars"]):
        raise typer.Exit(MISSED)


def table_of(results: list[dict[str, Any]]) -> Table:
    """Return the bars as a table."""
    from spume.validation.report import limits, number

    table = folding_table("case", "quantity", "bar", "reached", "at", "")
    colours = {"holds": "green", "MISSED": "red"}
    for study in results:
        for bar in study["bars"]:
            word = bar["verdict"]
            colour = colours.get(word)
            table.add_row(
                f"{study['number']} {study['case']}",
                (f"{bar['series']}: " if bar["series"] else "") + bar["metric"],
                limits(bar),
                number(bar["reached"]),
                f"{study['length']} = {bar['cells']}",
                f"[{colour}]{word}[/{colour}]" if colour else word,
            )
    return table
