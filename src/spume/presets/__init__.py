"""Presets: models for a class of problems, chosen from the atlas, each a TOML file of this folder found by its name.

A preset holds defaults of the tables ``step`` and ``time`` of a case. What a case says goes before them, key by key,
also inside a table that names no model of its own. The table ``step`` of a preset is about one algorithm and says
nothing where a case chooses another.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from spume.named import Parameters, Scheme

FOLDER = Path(__file__).parent
USUAL = "recommended"


def names() -> list[str]:
    """Return the names of all presets, the usual one first."""
    return sorted((path.stem for path in FOLDER.glob("*.toml")), key=lambda name: (name != USUAL, name))


@cache
def _text(name: str) -> str:
    return (FOLDER / f"{name}.toml").read_text(encoding="utf-8")


def applied(name: str, document: Mapping[str, Any], usual_step: str) -> dict[str, Any]:
    """Return a case's document with the defaults of a preset where it says nothing.

    Args:
        name: of the preset.
        document: the tables of a case; a model in place of its table is taken as it is.
        usual_step: algorithm that a table ``step`` without a name is about.
    """
    result = dict(document)
    for key, defaults in tomllib.loads(_text(name)).items():
        given = result.get(key, {})
        given = {"name": given} if isinstance(given, str) else given
        if isinstance(given, Parameters) and not isinstance(given, Scheme):
            given = {name: getattr(given, name) for name in given.model_fields_set}
        if not isinstance(given, Mapping):
            continue
        if key == "step":
            defaults = {"name": usual_step, **defaults}
            if given.get("name", defaults["name"]) != defaults["name"]:
                continue
        result[key] = _together(defaults, given)
    return result


def _together(defaults: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return what is given and the defaults of the rest; a table that names no model is about the default one."""
    result = {**defaults, **given}
    for key in defaults.keys() & given.keys():
        one, other = defaults[key], given[key]
        one = {"name": one} if isinstance(one, str) else one
        if isinstance(one, Mapping) and isinstance(other, Mapping) and "name" not in other:
            result[key] = _together(one, other)
    return result
