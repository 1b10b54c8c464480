"""The command line: one file per command, or per pair of them."""

import importlib
import pkgutil

from spume.cli.app import app

for _module in sorted(module.name for module in pkgutil.iter_modules(__path__)):
    if _module != "__main__":
        importlib.import_module(f"{__name__}.{_module}")


def main() -> None:
    """Run the command line; the entry point ``spume``."""
    app(prog_name="spume")
