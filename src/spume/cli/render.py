"""spume render: rendered pictures and films of 3D runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spume.cli.app import answers, app, new_console
from spume.cli.plot import ColourOption, MapOption, RangeOption, RunArgument


@app.command()
@answers
def render(
    run: RunArgument,
    times: Annotated[
        list[float] | None,
        typer.Option("--time", metavar="T", help="Show the frame nearest to this time \\[s]. May be repeated."),
    ] = None,
    film: Annotated[bool, typer.Option(help="Make a film of the run as well.")] = True,
    colour: ColourOption = None,
    colour_range: RangeOption = None,
    colour_map: MapOption = None,
    camera: Annotated[
        tuple[float, float] | None,
        typer.Option("--view", metavar="AZIMUTH HEIGHT", help="Direction from which it is seen \\[degrees]."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the pictures. Default: plots in the run folder.")] = None,
) -> None:
    """Render the water surface of a 3D run to PNG and MP4, without a screen.

    The surface is reconstructed from the particles and smoothed over about two spacings; single drops are balls.
    Needs the extra view: pip install "spume[view]".

    Examples:
      spume render dam-break-3d
      spume render dam-break-3d --time 0.5 --no-film --colour pressure
      spume render dam-break-3d --view -120 25
    """
    import spume
    from spume.outputs.figures import settings_of
    from spume.outputs.film import ffmpeg
    from spume.outputs.render import INSTALL, render_run

    results = spume.open(run)
    settings = settings_of(results, colour=colour, colour_range=colour_range, map=colour_map, view_deg=camera)
    console = new_console()
    if not console.is_terminal:
        drawn = render_run(results, out, times=times or (), film=film, settings=settings)
    else:
        with console.status("rendering …") as status:
            drawn = render_run(
                results, out, times=times or (), film=film, settings=settings,
                told=lambda done, all_: status.update(f"rendering the film: {done} of {all_} pictures"),
            )  # fmt: skip
    for path in drawn:
        console.print(str(path), highlight=False, soft_wrap=True)
    if film and ffmpeg() is None:
        console.print(f"MP4 files need ffmpeg: {INSTALL}, or install ffmpeg", highlight=False, markup=False)
