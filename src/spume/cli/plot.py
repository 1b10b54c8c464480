"""spume plot: figures of a run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spume.cli.app import answers, app, new_console

RunArgument = Annotated[Path, typer.Argument(metavar="RUN", help="A run folder.")]
ColourOption = Annotated[
    str | None, typer.Option(metavar="FIELD", help="speed, pressure or another scalar of the frames.")
]
RangeOption = Annotated[
    tuple[float, float] | None,
    typer.Option("--range", metavar="LOW HIGH", help="Ends of the colour scale, SI units. Default: from the frames."),
]
MapOption = Annotated[
    str | None, typer.Option("--map", metavar="NAME", help="Colour map: water, viridis, cividis, magma, coolwarm …")
]


@app.command()
@answers
def plot(
    run: RunArgument,
    times: Annotated[
        list[float] | None,
        typer.Option("--time", metavar="T", help="Draw the frame nearest to this time \\[s]. May be repeated."),
    ] = None,
    gauges: Annotated[
        list[str] | None, typer.Option("--gauge", metavar="NAME", help="Draw this gauge. May be repeated.")
    ] = None,
    line: Annotated[
        str | None,
        typer.Option(metavar="X,Y:X,Y", help="Draw pressure and elevation along this line over time \\[m]."),
    ] = None,
    colour: ColourOption = None,
    colour_range: RangeOption = None,
    colour_map: MapOption = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the figures. Default: plots in the run folder.")] = None,
    file_format: Annotated[str, typer.Option("--format", metavar="FORMAT", help="png, pdf or svg.")] = "png",
) -> None:
    """Draw figures of a run: snapshots, gauges against the experiment, space–time diagrams.

    Without --time, --gauge and --line all of them are drawn, else only what is named.

    Examples:
      spume plot dam-break
      spume plot dam-break --time 0.4 --time 0.8 --colour pressure
      spume plot dam-break --gauge pressure-1 --format pdf
      spume plot dam-break --line 1.61,0:1.61,0.4
    """
    import spume
    from spume.outputs.figures import plot_run, settings_of

    results = spume.open(run)
    settings = settings_of(results, colour=colour, colour_range=colour_range, map=colour_map)
    drawn = plot_run(
        results,
        out,
        times=times or (),
        gauges=gauges or (),
        line=None if line is None else points_of(line),
        settings=settings,
        file_format=file_format,
    )
    console = new_console()
    for path in drawn:
        console.print(str(path), highlight=False, soft_wrap=True)
    if not drawn:
        console.print(f"{run}: nothing to draw: {'; '.join(results.problems) or 'no frames and no gauges'}")


def points_of(text: str) -> tuple[list[float], list[float]]:
    """Return the two points that ``0,0:1.6,0`` means."""
    try:
        first, last = ([float(number) for number in point.split(",")] for point in text.split(":"))
    except ValueError:
        raise typer.BadParameter(
            f"{text!r}: two points as X,Y:X,Y, or X,Y,Z:X,Y,Z in 3D", param_hint="--line"
        ) from None
    return first, last
