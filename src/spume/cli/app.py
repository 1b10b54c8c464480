"""The application: its options, what every command shares, and how mistakes become messages and exit codes."""

from __future__ import annotations

import functools
import logging
from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

import typer

from spume.terminal import new_console as new_console

if TYPE_CHECKING:
    from spume.case import Case

DONE, INPUT, DIVERGED, STOPPED = 0, 2, 3, 4

app = typer.Typer(
    help="Simulate flow with a free surface by the Moving Particle Semi-implicit (MPS) method.\n\n"
    "Begin with: spume run dam-break. Or with a case of your own: spume new my-tank --from dam-break, then "
    "spume check my-tank.toml and spume run my-tank.toml. spume COMMAND --help tells more.",
    epilog="Exit codes: 0 done, 2 input to correct, 3 the simulation diverged, 4 interrupted, 5 a bar is missed. "
    "The shell completes commands, options and names of cases after: spume --install-completion.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def complete_case(incomplete: str) -> list[str]:
    """Return the built-in cases and the case files here that begin so, for the shell."""
    from pathlib import Path

    built_in = sorted(path.parent.name for path in (Path(__file__).parents[1] / "cases").glob("*/case.toml"))
    return [name for name in (*built_in, *map(str, Path().glob("*.toml"))) if name.startswith(incomplete)]


CASE_HELP = "A case file, or the name of a built-in case (spume cases)."
CaseArgument = Annotated[str, typer.Argument(metavar="CASE", help=CASE_HELP, autocompletion=complete_case)]
SetOption = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Replace a key: spacing=0.02, time.end=0.1, body.tank.slip=free-slip. May be repeated.",
    ),
]
DeviceOption = Annotated[
    str | None, typer.Option(help="cpu, cuda, vulkan, metal or amdgpu. Default: SPUME_DEVICE, else cpu.")
]
ThreadsOption = Annotated[int | None, typer.Option(min=1, help="Processor threads. Default: all that may be used.")]
PrecisionOption = Annotated[str | None, typer.Option(help="double or single.")]


def answers(command: Callable[..., None]) -> Callable[..., None]:
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
            code = {"DeviceError": INPUT, "ArrayTooLong": INPUT, "Diverged": DIVERGED}.get(type(error).__name__)
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


def load_case(
    case: str, replaced: list[str] | None, device: str | None, threads: int | None, precision: str | None
) -> Case:
    """Return the case with the command line's replacements; options go before --set."""
    from spume.case import load

    options = {"device": device, "threads": threads, "precision": precision}
    return load(case, replaced or [], {key: value for key, value in options.items() if value is not None})
