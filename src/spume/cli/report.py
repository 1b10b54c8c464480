"""spume report: a page that shows a run, or compares several."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spume.cli.app import answers, app, new_console


@app.command()
@answers
def report(
    runs: Annotated[list[Path], typer.Argument(metavar="RUN…", help="Run folders; several are compared.")],
    out: Annotated[
        Path | None,
        typer.Option(help="The page. Default: report.html in the run folder, or here for several runs."),
    ] = None,
    show: Annotated[bool, typer.Option("--open", help="Open the page in the browser.")] = False,
) -> None:
    """Write one HTML file that shows a run or compares several: particles, gauges, budgets, cost, case.

    The file needs nothing else: it opens without a network, and can be sent as it is.

    Examples:
      spume report dam-break --open
      spume report coarse fine --out comparison.html
    """
    from spume.report import write_report
    from spume.results import Results

    console = new_console()
    opened = [Results(run) for run in runs]
    path = write_report(opened, out)
    for run in opened:
        for problem in dict.fromkeys(run.problems):
            console.print(f"{run.path}: {problem}", highlight=False, soft_wrap=True, markup=False)
    console.print(f"Report: {path} ({path.stat().st_size / 1e6:.1f} MB)", highlight=False, soft_wrap=True)
    if show:
        import webbrowser

        if not webbrowser.open(path.resolve().as_uri()):
            console.print(f"No browser was found here: open {path.resolve()} in one", highlight=False, soft_wrap=True)
