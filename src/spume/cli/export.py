"""spume export: frames of a run for other programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from spume.cli.app import answers, app, new_console
from spume.cli.plot import RunArgument


@app.command()
@answers
def export(
    run: RunArgument,
    file_format: Annotated[
        str,
        typer.Option(
            "--format",
            metavar="FORMAT",
            help="csv, npz or vtu: the particles; ply, stl, obj or vtp: the surface of the water (3D).",
        ),
    ] = "csv",
    times: Annotated[
        list[float] | None,
        typer.Option("--time", metavar="T", help="Export the frame nearest to this time \\[s]. May be repeated."),
    ] = None,
    fields: Annotated[
        list[str] | None,
        typer.Option("--field", metavar="FIELD", help="Only this field, besides the position. May be repeated."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the files. Default: export in the run folder.")] = None,
) -> None:
    """Write frames of a run for other programs, a file per frame.

    ParaView needs none of this: it opens run.vtkhdf. Formats vtu, ply, stl, obj and vtp need the extra view:
    pip install "spume[view]".

    Examples:
      spume export dam-break --format vtu
      spume export dam-break --time 0.5 --field velocity --field pressure
      spume export dam-break-3d --format ply
    """
    import spume
    from spume.outputs.export import export as write

    results = spume.open(run)
    chosen = [results.at(t) for t in times] if times else results
    written = write(chosen, run / "export" if out is None else out, file_format, fields or ())
    first = f"{written[0]}" + (f" … {written[-1].name}" if len(written) > 1 else "") if written else "nothing to write"
    new_console().print(f"{first} ({len(written)} files)", highlight=False, soft_wrap=True)
