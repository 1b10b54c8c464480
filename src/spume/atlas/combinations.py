"""The combinations of models that the atlas compares: one slot changed at a time, and what papers propose."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from spume import named, presets
from spume.steps.project_in_place import ProjectInPlace


@dataclass(frozen=True)
class Combination:
    """Models that differ from the default ones."""

    name: str
    """For tables and folders."""
    settings: tuple[str, ...]
    """Keys that a case replaces."""
    slot: str
    """Slot that is varied, or ``published``, ``preset``."""
    layers: int = 3
    """Layers of walls that the widest operator needs."""


SLOTS = (
    "shifting", "gradient", "free_surface", "source", "divergence", "laplacian", "wall_model", "collision", "viscosity",
)  # fmt: skip
"""Slots of the step that are varied, all registered models of each."""

FORMER = (
    "step={number_density='original', free_surface='blended', divergence='blended', gradient='completed', "
    "viscosity={name='explicit', laplacian='original'}, source='divergence-density', shifting='fickian', "
    "volume_order=1}"
)
"""The default models until 2026-11-25."""

PUBLISHED = {
    "Koshizuka & Oka 1996": ("step='predict-move-project'",),
    "Khayyer & Gotoh 2009 (CMPS)": ("step={name='predict-move-project', gradient='cmps'}",),
    "Khayyer & Gotoh 2011 (HS, HL, ECS, GC)": (
        "step={name='predict-move-project', gradient='corrected', laplacian='higher-order', "
        "source='error-compensating'}",
    ),
    "Tanaka & Masunaga 2010": ("step={name='predict-move-project', source='divergence-density'}",),
    "Kondo & Koshizuka 2011": ("step={name='predict-move-project', source='three-term'}",),
    "Shakibaeinia & Jin 2010": ("step='weakly-compressible'",),
    "Xu 2009": (
        "step={gradient='corrected', source='divergence', divergence='corrected', "
        "shifting={name='fickian', advective=2.0}}",
    ),
}
"""Sets of models of publications, as far as they are here."""

FORMS = {
    "shifting fickian, strength 0.3": "step.shifting={name='fickian', strength=0.3}",
    "shifting fickian, strength 0.5": "step.shifting={name='fickian', strength=0.5}",
    "shifting fickian, advective 2": "step.shifting={name='fickian', advective=2.0}",
    "shifting along the surface, without images": "step.shifting={name='fickian-along-surface', images=false}",
    "gradient cmps, consistent": "step.gradient={name='cmps', form='consistent'}",
    "gradient stabilised, consistent": "step.gradient={name='stabilised', form='consistent'}",
    "source divergence-density, 0.2": "step.source={name='divergence-density', gamma=0.2}",
    "source divergence-density, smoothed, 0.01": "step.source={name='divergence-density', smoothed=true, gamma=0.01}",
    "number_density with weight inverse": "step.number_density.weight='inverse'",
    "number_density with weight quadratic": "step.number_density.weight='quadratic'",
    "gradient imaged, all of a wall": "step.gradient.normals=false",
    "divergence bounded, all of a wall": "step.divergence.normals=false",
    "viscosity explicit, wall function": "step.viscosity.wall_function='power-law'",
    "viscosity explicit, turbulence and wall function": (
        "step.viscosity={name='explicit', laplacian='distance', turbulence='smagorinsky', wall_function='power-law'}"
    ),
    "viscosity explicit, laplacian original": "step.viscosity.laplacian='original'",
    "volume_order 1": "step.volume_order=1",
    "courant 0.1": "time.courant=0.1",
    "courant 0.4": "time.courant=0.4",
}
"""Models with parameters other than their defaults, and what is no model."""


def combinations() -> list[Combination]:
    """Return all combinations: the default, one slot varied at a time, published sets, presets."""
    former = Combination("former default", (FORMER,), "published")
    found = [Combination("default", (), "default"), former, *_varied(), *_published()]
    others = [name for name in presets.names() if name != presets.USUAL]
    return found + [Combination(f"preset {name}", (f"preset='{name}'",), "preset") for name in others]


def _varied() -> Iterator[Combination]:
    named.load_all()
    default: Any = ProjectInPlace()
    for slot in SLOTS:
        for scheme in named.schemes(slot):
            if type(getattr(default, slot)) is scheme or not _fits(slot, scheme):
                continue
            models: Any = {slot: scheme()}
            layers = math.floor(ProjectInPlace(**models).largest_radius()) + 1
            yield Combination(f"{slot} {scheme.key}", (f"step.{slot}='{scheme.key}'",), slot, max(layers, 3))
        for name, setting in FORMS.items():
            if name.startswith(slot):
                yield Combination(name, (setting,), slot)
    for name, setting in FORMS.items():
        if not name.startswith(SLOTS):
            yield Combination(name, (setting,), "other")


def _fits(slot: str, scheme: type[Any]) -> bool:
    """Return whether the default step takes a model: a source of moved positions it does not."""
    models: Any = {slot: scheme()}
    try:
        ProjectInPlace(**models)
    except ValueError:
        return False
    return True


def _published() -> Iterator[Combination]:
    for name, settings in PUBLISHED.items():
        yield Combination(name, settings, "published")
