"""spume bench: what a step costs, and where."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from spume.cli.app import (
    CASE_HELP,
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
from spume.terminal import folding_table

if TYPE_CHECKING:
    from rich.table import Table

    from spume.bench import Result


@app.command()
@answers
def bench(
    case: Annotated[str, typer.Argument(metavar="CASE", help=CASE_HELP, autocompletion=complete_case)] = "dam-break-3d",
    spacing: Annotated[float | None, typer.Option(help="Spacing l0 \\[m].")] = None,
    end_time: Annotated[float | None, typer.Option(help="Simulated time \\[s]. Default: 30 steps.")] = None,
    steps: Annotated[int | None, typer.Option(min=1, help="Steps to measure.")] = None,
    replaced: SetOption = None,
    device: DeviceOption = None,
    threads: ThreadsOption = None,
    precision: PrecisionOption = None,
    file: Annotated[Path | None, typer.Option("--json", help="Write the figures to this file as well.")] = None,
) -> None:
    """Run a case without output and print what its steps cost: time, bytes, bandwidth by stage.

    Examples:
      spume bench
      spume bench dam-break-3d --spacing 0.005 --threads 8 --json bench.json
    """
    from spume.bench import bench as measure

    settings = list(replaced or [])
    settings += [] if spacing is None else [f"spacing={spacing!r}"]
    settings += [] if end_time is None else [f"time.end={end_time!r}"]
    loaded = load_case(case, settings, device, threads, precision)
    if steps is None and end_time is None:
        steps = 30
    result = measure(loaded, steps, device=device, threads=threads, precision=precision)
    console = new_console()
    console.print(table_of(result))
    console.print(summary_of(result), highlight=False)
    if file is not None:
        file.write_text(json.dumps(result.to_json(), indent=2) + "\n", encoding="utf-8")
        console.print(f"Figures: {file}", highlight=False)


def table_of(result: Result) -> Table:
    """Return the stages as a table."""
    title = f"{result.case}, l0 = {result.spacing:g} m: {result.fluid:,} fluid particles, {result.rows:,} rows"
    table = folding_table("stage", title=title, title_justify="left")
    for head in ("ns per fluid particle", "share", "bytes per row", "GB/s"):
        table.add_column(head, justify="right", overflow="fold")
    total = result.seconds / max(result.steps, 1)
    for stage in result.stages:
        moved = "" if stage.bytes is None else f"{stage.bytes / max(result.active, 1):,.0f}"
        rate = "" if stage.bytes is None or stage.seconds <= 0 else f"{stage.bytes / stage.seconds / 1e9:.1f}"
        share = f"{100 * stage.seconds / total:.0f} %" if total else ""
        table.add_row(stage.name, f"{stage.seconds / max(result.fluid, 1) * 1e9:,.1f}", share, moved, rate)
    return table


def summary_of(result: Result) -> str:
    """Return the other figures as lines."""
    speed = result.simulated / result.seconds if result.seconds else 0.0
    rows = max(result.rows, 1)
    lines = [
        f"{result.steps} steps on {result.device}, {result.threads} threads, {result.precision} precision: "
        f"{result.microseconds:.3g} us per fluid particle and step (median), "
        f"{result.median_step / rows * 1e6:.3g} per row",
        f"{result.active:,} rows near fluid take part; mean dt {result.mean_dt:.3g} s, "
        f"{result.iterations:.1f} pressure iterations, |n - n0|/n0 = {100 * result.density_error:.2f} %",
        f"{speed:.4g} simulated seconds per second of wall time",
        f"first steps, with compilation: {result.compilation:.1f} s",
        f"a copy moves {result.copy / 1e9:.1f} GB/s here; the bytes of a stage count each value once",
        f"memory: {result.peak_memory / 2**20:,.0f} MiB all in ({result.peak_memory / rows:,.0f} B per row), of which "
        f"table, lists and matrix {result.table_memory / rows:,.0f} B per row",
    ]
    return "\n".join(lines)
