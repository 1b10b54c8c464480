"""spume run: a case to its results."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spume.cli.app import (
    STOPPED,
    CaseArgument,
    DeviceOption,
    PrecisionOption,
    SetOption,
    ThreadsOption,
    answers,
    app,
    load_case,
    new_console,
)


@app.command()
@answers
def run(
    case: CaseArgument,
    out: Annotated[
        Path | None,
        typer.Option(help="Run folder, new or empty. Default: the case's name, numbered if it exists."),
    ] = None,
    replaced: SetOption = None,
    device: DeviceOption = None,
    threads: ThreadsOption = None,
    precision: PrecisionOption = None,
) -> None:
    """Run a case and write its results."""
    console = new_console()
    loaded = load_case(case, replaced, device, threads, precision)
    from spume.run import INTERRUPTED, make_folder, run_folder
    from spume.run import run as run_case

    folder = run_folder(loaded.origin.label) if out is None else out
    make_folder(folder)  # before anything long: what is there must not be overwritten
    console.print(f"{loaded.title or loaded.origin.label}: results in {folder}", highlight=False)
    result = run_case(loaded, folder, console=console)
    figures = result.simulation
    words = f"{figures.step_index} steps to t = {figures.time:.4g} s; results in {result.folder}"
    if result.status == INTERRUPTED:
        console.print(f"Interrupted after {words}", highlight=False)
        raise typer.Exit(STOPPED)
    console.print(f"Done: {words}", highlight=False)
