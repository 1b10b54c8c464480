"""The command line."""

from __future__ import annotations

import functools
import json
import logging
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from spume.case import Case

DONE, INPUT, DIVERGED, STOPPED = 0, 2, 3, 4

app = typer.Typer(
    help="Simulate flow with a free surface by the Moving Particle Semi-implicit (MPS) method.",
    epilog="Exit codes: 0 done, 2 input to correct, 3 the simulation diverged, 4 interrupted.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

CaseArgument = Annotated[
    str, typer.Argument(metavar="CASE", help="A case file, or the name of a built-in case (spume cases).")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Replace a key: spacing=0.02, time.end=0.1, body.tank.slip=free-slip. May be repeated.",
    ),
]
DeviceOption = Annotated[
    str | None, typer.Option(help="cpu, cuda, vulkan, metal or amdgpu; default: SPUME_DEVICE, else cpu.")
]
ThreadsOption = Annotated[int | None, typer.Option(min=1, help="Processor threads; default: all that may be used.")]
PrecisionOption = Annotated[str | None, typer.Option(help="double or single.")]


def _answers(command: Callable[..., None]) -> Callable[..., None]:
    """Turn what a user can mend into a message and an exit code; anything else keeps its traceback."""

    @functools.wraps(command)
    def answering(*args: Any, **kwargs: Any) -> None:
        try:
            command(*args, **kwargs)
        except (ValueError, OSError) as error:
            from spume.problems import CaseError

            if not isinstance(error, CaseError | OSError):
                raise
            _complain(str(error))
            raise typer.Exit(INPUT) from None
        except RuntimeError as error:
            code = {"DeviceError": INPUT, "Diverged": DIVERGED}.get(type(error).__name__)
            if code is None:
                raise
            _complain(str(error))
            raise typer.Exit(code) from None
        except KeyboardInterrupt:
            _complain("interrupted")
            raise typer.Exit(STOPPED) from None

    return answering


def _complain(text: str) -> None:
    for line in text.splitlines():
        typer.echo(f"error: {line}", err=True)


@app.command()
@_answers
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
    console = _console()
    loaded = _load(case, replaced, device, threads, precision)
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


@app.command()
@_answers
def check(
    case: CaseArgument,
    out: Annotated[
        Path | None, typer.Option(help="Picture of the initial particles. Default: <case>-initial.png.")
    ] = None,
    replaced: SetOption = None,
    threads: ThreadsOption = None,
) -> None:
    """Read a case, draw its initial particles, predict particles, memory and time; compute nothing."""
    console = _console()
    loaded = _load(case, replaced, None, threads, None)
    from rich.table import Table

    from spume import build, kernels
    from spume.outputs.pictures import draw_frames, frame_of
    from spume.run import duration

    rows = build.initial_rows(loaded)
    build.check_gauges(loaded, rows)
    cores = loaded.threads or kernels.available_threads()
    predicted = build.predict(loaded, rows, cores)
    table = Table(title=loaded.title or loaded.origin.label, show_header=False, title_justify="left")
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
    table.add_row("time", f"about {duration(predicted.seconds)} with {cores} threads")
    picture = Path(f"{loaded.origin.label}-initial.png") if out is None else out
    picture.parent.mkdir(parents=True, exist_ok=True)
    settings = loaded.output
    if not rows["velocity"].any():  # one colour would show nothing
        settings = settings.model_copy(update={"colour": "pressure", "colour_range": None})
    frame = frame_of(build.initial_snapshot(loaded, rows))
    draw_frames([frame], picture, settings, loaded.title)
    console.print(table)
    console.print(f"The case is in order. Initial particles: {picture}", highlight=False)


@app.command()
@_answers
def cases() -> None:
    """List the built-in cases."""
    import tomllib

    from rich.table import Table

    from spume.named import CASES

    table = Table("name", "title")
    for path in sorted(CASES.glob("*/case.toml")):
        with path.open("rb") as file:
            table.add_row(path.parent.name, tomllib.load(file).get("title", ""))
    console = _console()
    console.print(table)
    console.print("Run one with: spume run NAME", highlight=False)


@app.command()
@_answers
def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the case; the file is NAME.toml.")],
    source: Annotated[
        str | None,
        typer.Option("--from", metavar="CASE", help="Case to start from, a file or a built-in name."),
    ] = None,
) -> None:
    """Write a commented case file."""
    from spume.named import CASES

    path = Path(f"{name.removesuffix('.toml')}.toml")
    if not re.fullmatch(r"[^\s/\\.][^\s/\\]*", name.removesuffix(".toml")):
        raise typer.BadParameter(f"{name!r}: a file name without blanks or folders is allowed", param_hint="NAME")
    if path.exists():
        raise FileExistsError(f"{path} exists already; nothing is overwritten: choose another name")
    if source is None:
        text = (CASES / "template.toml").read_text(encoding="utf-8").format(name=path.stem)
    else:
        from spume.case import find_case

        origin, _ = find_case(source)
        text = origin.read_text(encoding="utf-8")
    path.write_text(text, encoding="utf-8")
    _console().print(f"Wrote {path}. Look at it, then: spume check {path}", highlight=False)


@app.command()
@_answers
def schemes(
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    family: Annotated[str | None, typer.Option(help="Only this family.")] = None,
) -> None:
    """List the models: family, name, systems of the literature, source, order, what is conserved."""
    from spume import named

    named.load_all()
    chosen = [scheme for scheme in named.schemes() if family in (None, scheme.family)]
    if not chosen:
        known = sorted({scheme.family for scheme in named.schemes()})
        near = named.nearest_match(str(family), known)
        raise typer.BadParameter(f"{family!r}: one of {', '.join(known)}{near}", param_hint="--family")
    if as_json:
        rows = [
            {
                "family": scheme.family,
                "name": scheme.key,
                "ids": list(scheme.ids),
                "source": scheme.reference,
                "order": scheme.order,
                "conserves": sorted(scheme.conserves),
                "doc": (scheme.__doc__ or "").strip().split("\n")[0],
            }
            for scheme in chosen
        ]
        typer.echo(json.dumps(rows, indent=2, ensure_ascii=False))
        return
    from rich.table import Table

    table = Table("family", "name", "ids", "source", "order", "conserves")
    for scheme in chosen:
        order = "" if scheme.order is None else str(scheme.order)
        ids, conserves = " ".join(scheme.ids), ", ".join(sorted(scheme.conserves))
        table.add_row(scheme.family, scheme.key, ids, scheme.reference, order, conserves)
    _console().print(table)


@app.command()
@_answers
def schema() -> None:
    """Print the JSON Schema of case files, with which editors complete and check them."""
    from spume.case import schema as case_schema

    typer.echo(json.dumps(case_schema(), indent=2, ensure_ascii=False))


def _version(value: bool) -> None:
    if value:
        import spume

        typer.echo(f"spume {spume.__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
    verbose: Annotated[bool, typer.Option("--verbose", "-v", help="Log what happens in detail.")] = False,
) -> None:
    from rich.console import Console
    from rich.logging import RichHandler

    handler = RichHandler(console=Console(stderr=True), show_time=False, show_path=False)
    logger = logging.getLogger("spume")
    logger.handlers[:] = [handler]
    logger.setLevel(logging.DEBUG if verbose else logging.INFO)
    logger.propagate = False


def _console() -> Console:
    from rich.console import Console

    return Console()


def _load(
    case: str, replaced: list[str] | None, device: str | None, threads: int | None, precision: str | None
) -> Case:
    """Return the case with the command line's replacements; options go before --set."""
    from spume.case import load

    options = {"device": device, "threads": threads, "precision": precision}
    return load(case, replaced or [], {key: value for key, value in options.items() if value is not None})


def main() -> None:
    """Run the command line; the entry point ``spume``."""
    app(prog_name="spume")


if __name__ == "__main__":
    main()
