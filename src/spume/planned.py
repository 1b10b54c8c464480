"""Names of schemes that are planned but not there yet: a case that asks for one is told so."""

from __future__ import annotations

from collections.abc import Mapping

PLANNED: Mapping[str, Mapping[str, str]] = {
    "body": {
        "floating": "L8", "ice": "L9", "inflow": "G1", "outflow": "G1", "open-boundary": "G3", "wave-maker": "G3",
        "elastic": "L2", "shell": "L4", "porous": "L10", "grains": "J5", "mirror": "F5", "polygon": "F11",
    },
    "shape": {"bathymetry": ""},
    "wall_model": {"mirror": "F5", "lennard-jones": "F8", "polygon": "F11"},
}  # fmt: skip
"""Families, names, and the row of ``docs/systems.md`` that lists each; empty where only the README does."""

_INSTEAD = {
    "wave-maker": 'a piston or a flap is a body of kind "wall" with a motion',
    "bathymetry": "a polygon, an extrusion or a drawing (stl) can be the bed",
}


def planned(family: str, name: str) -> str:
    """Return ``"planned, not there yet (L8 …); "`` for a name that is planned, else an empty text."""
    names = PLANNED.get(family, {})
    if name not in names:
        return ""
    row = f" ({names[name]} of docs/systems.md)" if names[name] else ""
    instead = f" {_INSTEAD[name]};" if name in _INSTEAD else ""
    return f"planned, not there yet{row};{instead} "
