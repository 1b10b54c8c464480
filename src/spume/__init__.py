"""Spume: Moving Particle Semi-implicit (MPS) simulation of free-surface flow.

A case in Python is what a case file says, as constructor calls::

    import spume

    case = spume.Case(
        title="A column of water that collapses",
        spacing=0.01,
        time=spume.Time(end=1.0),
        fluid=[spume.Fluid(name="water", shape=spume.Box(lower=[0.0, 0.0], upper=[0.6, 0.3]))],
        body=[spume.Wall(name="tank", shape=spume.Tank(lower=[0, 0], upper=[1.61, 0.6], open=["top"]))],
    )
    case.run("column")  # or, step by step:

    simulation = case.build()
    while not simulation.done:
        simulation.advance()

Names are imported when they are first used, so that ``import spume`` is quick.
"""

import importlib
from typing import Any

_HOME = {
    "spume.case": ("Case", "CaseError", "Domain", "Fluid", "Time", "load"),
    "spume.geometry": (
        "Box",
        "Cylinder",
        "Difference",
        "Extrusion",
        "Intersection",
        "Polygon",
        "Sphere",
        "Stl",
        "Tank",
        "Union",
    ),
    "spume.bodies.wall": ("Wall",),
    "spume.citation": ("cite",),
    "spume.outputs": ("OutputSettings", "Reference"),
    "spume.outputs.gauges": ("Elevation", "Energy", "Force", "Front", "Momentum", "Pressure", "Velocity", "Volume"),
    "spume.history": ("History",),
    "spume.simulation": ("Simulation",),
    "spume.run": ("Run", "resume"),
    "spume.results": ("Results", "RunFolderError", "open"),
}
_MODULE = {name: module for module, names in _HOME.items() for name in names}

__all__ = [
    "__version__",
    *_MODULE,
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import PackageNotFoundError, version

        try:
            return version("spume")
        except PackageNotFoundError:  # used from a source tree without being installed
            return "0+unknown"
    if name in _MODULE:
        return getattr(importlib.import_module(_MODULE[name]), name)
    raise AttributeError(f"module 'spume' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
