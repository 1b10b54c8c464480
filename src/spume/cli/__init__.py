"""The command line: one file per command, or per pair of them."""

import importlib
import inspect
import pkgutil

from spume.cli.app import app

for _module in sorted(module.name for module in pkgutil.iter_modules(__path__)):
    if _module != "__main__":
        importlib.import_module(f"{__name__}.{_module}")

PANELS = {
    "Simulate": ("new", "cases", "check", "run"),
    "Look at results": ("report", "plot", "render", "export", "cite"),
    "Compare": ("validate", "atlas"),
    "Models and case files": ("schemes", "schema", "new-scheme"),
    "This machine": ("doctor", "bench"),
}
"""Groups of commands in the help, in the order in which a user needs them."""


def _arrange() -> None:
    """Put the commands in the groups and the order of `PANELS`."""
    place = {name: (panel, number) for panel, names in PANELS.items() for number, name in enumerate(names)}
    for command in app.registered_commands:
        command.name = command.name or getattr(command.callback, "__name__", "").replace("_", "-")
        command.rich_help_panel = place.get(command.name, ("More", 0))[0]
        command.help = help_of(command.callback.__doc__ or "") if command.callback else ""
    order = [name for names in PANELS.values() for name in names]
    last = len(order)
    app.registered_commands.sort(key=lambda c: order.index(c.name) if c.name in order else last)


def help_of(docstring: str) -> str:
    """Return a docstring as the help of a command: paragraphs flow, examples keep their lines and are indented."""
    parts = []
    for paragraph in inspect.cleandoc(docstring).split("\n\n"):
        first, *lines = paragraph.replace("[", "\\[").split("\n")
        if first in ("Example:", "Examples:"):
            parts.append("\n".join([first, *(f"[cyan]  {line.strip()}[/cyan]" for line in lines)]))
        else:
            parts.append(" ".join([first, *(line.strip() for line in lines)]))
    return "\n\n".join(parts)


_arrange()


def main() -> None:
    """Run the command line; the entry point ``spume``."""
    app(prog_name="spume")
