"""spume doctor: what is there on this machine, and what to do about what is not."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Annotated

import typer

from spume.cli.app import INPUT, answers, app, new_console

if TYPE_CHECKING:
    from spume.doctor import Check

_MARKS = {"found": "[green]✓[/green]", "missing": "[yellow]–[/yellow]", "broken": "[red]✗[/red]"}


@app.command()
@answers
def doctor(
    quick: Annotated[bool, typer.Option("--quick", help="Leave out off-screen rendering and the self-test.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Examine the installation: libraries, devices, threads, disks, rendering; and run a self-test.

    The self-test is a small tank of water at rest, whose pressure is known. For each problem the remedy is printed.
    Exit code 0: all that a simulation needs is there; 2: something is missing.

    Examples:
      spume doctor
      spume doctor --json > machine.json
    """
    from spume.doctor import examine

    found = []
    if as_json:
        found = list(examine(quick))
        good = all(check.ok for check in found)
        typer.echo(json.dumps({"ok": good, "checks": [check.to_json() for check in found]}, indent=2))
    else:
        subject = ""
        console = new_console()
        for check in examine(quick):
            found.append(check)
            if check.subject != subject:
                subject = check.subject
                console.print(f"\n[bold]{subject}[/bold]")
            console.print(line_of(check), highlight=False, soft_wrap=True)
        _conclude(found)
    if not all(check.ok for check in found):
        raise typer.Exit(INPUT)


def line_of(check: Check) -> str:
    """Return what was found, with the remedy below."""
    from rich.markup import escape

    mark = "[red]✗[/red]" if not check.ok else _MARKS[check.state]
    text = f" {mark} {check.name:<22} {escape(check.value)}"
    return text + (f"\n   {'':<22} [dim]→ {escape(check.remedy)}[/dim]" if check.remedy else "")


def _conclude(found: list[Check]) -> None:
    console = new_console()
    bad = [check for check in found if not check.ok]
    if bad:
        names = ", ".join(f"{check.subject}: {check.name}" for check in bad)
        console.print(f"\n[red]Not ready[/red]: {names}", highlight=False)
        return
    less = sum(bool(check.remedy) for check in found)
    rest = f"; {less} optional things could be added" if less else ""
    console.print(f"\n[green]Ready[/green]: all that a simulation needs is there{rest}.", highlight=False)
