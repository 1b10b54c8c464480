"""spume run: a case to its results."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from spume.cli.app import (
    CASE_HELP,
    STOPPED,
    DeviceOption,
    PrecisionOption,
    SetOption,
    ThreadsOption,
    answers,
    app,
    complete_case,
    load_case,
    new_console,
)
from spume.progress import seconds_of

if TYPE_CHECKING:
    from spume.run import Run


def _wall_time(text: str | None) -> float | None:
    try:
        return None if text is None else seconds_of(text)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None


@app.command()
@answers
def run(
    case: Annotated[str | None, typer.Argument(metavar="CASE", help=CASE_HELP, autocompletion=complete_case)] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Run folder, new or empty. Default: the case's name, numbered if it exists."),
    ] = None,
    resume: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Continue the run of this folder from its last checkpoint; no CASE."),
    ] = None,
    max_wall_time: Annotated[
        str | None,
        typer.Option(
            metavar="TIME", help="Write a checkpoint and stop before this wall time is over: 01:30:00, 90min, 5400s."
        ),
    ] = None,
    replaced: SetOption = None,
    device: DeviceOption = None,
    threads: ThreadsOption = None,
    precision: PrecisionOption = None,
) -> None:
    """Run a case and write its results, or continue a run.

    It ends with a table that compares the gauges with measurements, where the case has some. Interrupted by Ctrl-C or
    a batch system, it stops after its step and writes a checkpoint.

    Examples:
      spume run dam-break
      spume run dam-break --set spacing=0.005 --out fine --threads 4
      spume run my-tank.toml --set body.tank.slip=free-slip
      spume run my-tank.toml --max-wall-time 23:30:00
      spume run --resume fine
      spume run --resume fine --set time.end=2.0
    """
    limit = _wall_time(max_wall_time)
    console = new_console()
    if resume is not None:
        _refuse({"CASE": case, "--out": out, "--precision": precision})
        _check_device(device)
        from spume.run import resume as resume_run

        console.print(f"Continuing {resume}", highlight=False)
        _report(
            lambda: resume_run(
                resume, replaced or [], device=device, threads=threads, console=console, max_wall_time=limit
            ),
            resume,
        )
        return
    if case is None:
        raise typer.BadParameter("Missing argument 'CASE' (or --resume DIR).")
    loaded = load_case(case, replaced, device, threads, precision)
    from spume.run import claimed, run_folder
    from spume.run import run as run_case

    folder = run_folder(loaded.origin.label) if out is None else out
    with claimed(folder):  # before anything long: what is there must not be overwritten
        _report(lambda: run_case(loaded, folder, console=console, max_wall_time=limit), folder)


def _removed(folder: Path) -> str:
    """Return how many particles left the region in the whole run, as words behind others; nothing where none did."""
    from spume.outputs import summary

    if not (folder / summary.FILE).is_file():
        return ""
    removed = int(summary.read(folder)["counts"].get("removed", 0))
    return f"; {removed:,} particles left the region and were removed" if removed else ""


def _refuse(given: dict[str, Any]) -> None:
    for name, value in given.items():
        if value is not None:
            raise typer.BadParameter(f"{name} does not go with --resume: the run folder says what is run, and where")


def _check_device(device: str | None) -> None:
    from spume.kernels import DEVICES, DeviceError

    if device is not None and device not in DEVICES:
        raise DeviceError(f"device = {device!r}: one of {', '.join(DEVICES)}")


def _report(compute: Any, folder: Path) -> None:
    """Run, and say how it ended."""
    from spume.outputs.disk import NotWritten
    from spume.run import INTERRUPTED

    console = new_console()
    goes_on = f"continue with: spume run --resume {folder}"
    try:
        result: Run = compute()
    except NotWritten as error:
        typer.echo(f"error: {error}", err=True)
        typer.echo(f"error: stopped, the last checkpoint is intact; make room and {goes_on}", err=True)
        raise typer.Exit(STOPPED) from None
    figures = result.simulation
    words = f"{figures.step_index} steps to t = {figures.time:.4g} s; results in {result.folder}"
    if result.status == INTERRUPTED:
        why = f" ({result.reason})" if result.reason else ""
        console.print(f"Interrupted after {words}{why}; {goes_on}", highlight=False, soft_wrap=True)
        raise typer.Exit(STOPPED)
    console.print(f"Done: {words}{_removed(result.folder)}", highlight=False)
