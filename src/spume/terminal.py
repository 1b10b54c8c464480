"""What is printed: a console that cuts nothing off, and tables whose columns fold."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

_UNLIMITED = 100_000  # characters a line: nothing that is printed is as wide


def new_console() -> Console:
    """Return the console that results are printed on.

    A file or a pipe has no width, where rich would take 80 characters; ``COLUMNS`` may give it one.
    """
    from rich.console import Console

    console = Console()
    if console.is_terminal or os.environ.get("COLUMNS"):
        return console
    return Console(width=_UNLIMITED)


def folding_table(*headers: str, **options: Any) -> Table:
    """Return a table of these columns that continues on the next line what a narrow terminal has no room for.

    Args:
        headers: head of each column.
        options: of rich's ``Table``.
    """
    from rich.table import Column, Table

    return Table(*(Column(header, overflow="fold") for header in headers), **options)
