"""spume check: what a case would take, and what it looks like."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spume.cli.app import CaseArgument, SetOption, ThreadsOption, answers, app, load_case, new_console
from spume.terminal import folding_table


@app.command()
@answers
def check(
    case: CaseArgument,
    out: Annotated[
        Path | None, typer.Option(help="Picture of the initial particles. Default: <case>-initial.png.")
    ] = None,
    replaced: SetOption = None,
    threads: ThreadsOption = None,
) -> None:
    """Read a case, draw its initial particles, predict particles, memory and time; compute nothing.

    Examples:
      spume check my-tank.toml
      spume check dam-break --set spacing=0.005 --threads 8
    """
    console = new_console()
    loaded = load_case(case, replaced, None, threads, None)
    from spume import advice, build, kernels
    from spume.outputs.pictures import draw_frames, frame_of
    from spume.prediction import device_of, predict
    from spume.progress import duration

    rows = build.initial_rows(loaded)
    build.check_gauges(loaded, rows)
    build.check_size(loaded, len(rows["kind"]))
    advice.warn(loaded, build.initial_snapshot(loaded, rows))
    cores = kernels.possible_threads(loaded.threads or kernels.worthwhile_threads(len(rows["kind"])))
    predicted = predict(loaded, rows, cores)
    advice.warn_of_time(loaded, predicted.seconds)
    table = folding_table("", "", title=loaded.title or loaded.origin.label, show_header=False, title_justify="left")
    table.add_row("spacing", f"{loaded.spacing:g} m, {loaded.dimension}D")
    for index, fluid in enumerate(loaded.fluid):
        count = int(((rows["kind"] == build.FLUID) & (rows["material"] == index)).sum())
        size, unit = count * loaded.spacing**loaded.dimension, f"m^{loaded.dimension}"
        text = f"{count:,} particles, {size:.4g} {unit} (the shape: {fluid.shape.measure():.4g} {unit})"
        table.add_row(f"fluid {fluid.name}", text)
    for index, body in enumerate(loaded.body):
        table.add_row(f"body {body.name}", f"{int((rows['body'] == index).sum()):,} particles")
    table.add_row("particles", f"{predicted.rows:,}, {predicted.fluid:,} of them fluid")
    table.add_row("gauges", ", ".join(gauge.name for gauge in loaded.gauge) or "none")
    table.add_row("memory", f"about {predicted.bytes / 2**20:,.0f} MiB")
    table.add_row("steps", f"about {predicted.steps:,} to {loaded.time.end:g} s")
    workers = f"with {cores} thread{'s' * (cores > 1)}"
    if (device := device_of(loaded)) != "cpu":
        workers = f"on {device}, if the card is as fast as an H100"
    table.add_row("time", f"about {duration(predicted.seconds)} {workers}")
    picture = Path(f"{loaded.origin.label}-initial.png") if out is None else out
    picture.parent.mkdir(parents=True, exist_ok=True)
    settings, initial = loaded.output, build.initial_snapshot(loaded, rows)
    known = settings.colour == "speed" or settings.colour in initial
    if not known or (settings.colour != "material" and not rows["velocity"].any()):  # one colour would show nothing
        settings = settings.model_copy(update={"colour": "pressure", "colour_range": None})
    frame = frame_of(initial, None if settings.colour == "speed" else settings.colour)
    draw_frames([frame], picture, settings, loaded.title, fluids=[fluid.name for fluid in loaded.fluid])
    console.print(table)
    console.print(f"The case is in order. Initial particles: {picture}", highlight=False)
