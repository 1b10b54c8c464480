"""The models of the method: a family is a folder, a scheme is one file in it."""

import importlib
import pkgutil
from importlib.metadata import entry_points


def discover() -> None:
    """Import every scheme of this package and those that others register as ``spume.schemes``."""
    for module in pkgutil.walk_packages(__path__, prefix=f"{__name__}."):
        importlib.import_module(module.name)
    for entry in entry_points(group="spume.schemes"):
        entry.load()
