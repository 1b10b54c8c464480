"""Weight function and effective radius: whoever has such a key computes with it."""

import numpy as np
import pytest

import asked
from measured import SCHEMES, claim, cloud_of
from spume.case import CaseError, load
from spume.problems import Problem
from spume.schemes.free_surface.number_density import LowNumberDensity
from spume.schemes.operator import Operator
from spume.schemes.weight.gaussian import Gaussian
from spume.schemes.weight.inverse import Inverse
from spume.schemes.weight.inverse_square import InverseSquare
from spume.schemes.weight.quadratic import Quadratic
from spume.steps.base import nested
from spume.steps.predict_move_project import PredictMoveProject
from spume.steps.project_in_place import ProjectInPlace

OPERATORS = [name for name, scheme in SCHEMES.items() if issubclass(scheme, Operator)]
SEVERAL = {"weight": (Inverse(), Gaussian(), Quadratic(), InverseSquare()), "re": (1.95, 2.1, 2.3, 2.7, 3.1)}


def numbers(name, key, value):
    """Return what a scheme computes on a disturbed cloud with another value of a key."""
    family, cloud = name.split(".")[0], cloud_of(name, 2)
    scheme = SCHEMES[name](**{key: value})
    entries = claim(name)["value"]
    entry = entries if isinstance(entries, dict) else entries[0]
    ask = getattr(asked, entry["ask"]) if "ask" in entry else asked.ASK[family]
    return ask(scheme, cloud, share=cloud.share)


@pytest.mark.parametrize("key", SEVERAL)
@pytest.mark.parametrize("name", OPERATORS)
def test_a_key_has_an_effect_or_is_none(name, key):
    scheme = SCHEMES[name]
    assert (key in scheme.table_keys()) == (key not in scheme.unused)
    if name == "laplacian.higher-order" and key == "weight":
        return  # it takes no other
    least = scheme.model_fields["re"].metadata[0].ge if scheme.model_fields["re"].metadata else 0.0
    values = [v for v in SEVERAL[key] if key == "weight" or v >= least]
    if key in scheme.unused:
        default = scheme.model_fields[key].default
        assert getattr(scheme(**{key: default}), key) == default
        for value in values:
            if value != default:
                with pytest.raises(CaseError, match=f"{key}.* has no effect on {scheme.family} '{scheme.key}'"):
                    scheme(**{key: value})
    else:
        first, *others = (numbers(name, key, value) for value in values)
        assert any(not np.array_equal(first, other) for other in others)


def test_a_case_is_told_where_and_why():
    with pytest.raises(CaseError) as caught:
        load("hydrostatic", ["step.free_surface={name='number-density', re=3.1, weight='gaussian'}"])
    option = "--set step.free_surface={name='number-density', re=3.1, weight='gaussian'}"
    why = "n is that of number_density, with the weight and the re given there; leave it out"
    message = f"has no effect on free_surface 'number-density': {why}"
    assert caught.value.problems == (
        Problem(option, "step.free_surface.weight", '"gaussian"', message),
        Problem(option, "step.free_surface.re", "3.1", message),
    )


def test_a_completed_case_does_not_hold_what_has_no_effect(tmp_path):
    """One written before that did, with the defaults, is read as it was."""
    chosen = ["step.free_surface='hybrid'", "step.shifting='none'", "step.viscosity.turbulence='none'"]
    case = load("hydrostatic", chosen)
    text = case.to_toml()
    held = {
        'free_surface = { name = "hybrid", re = 2.1': 'free_surface = { name = "hybrid", weight = "inverse", re = 2.1',
        'shifting = { name = "none" }': 'shifting = { name = "none", weight = { name = "inverse" }, re = 2.1 }',
        'turbulence = { name = "none" }': 'turbulence = { name = "none", weight = { name = "inverse" }, re = 2.1 }',
    }
    for now, before in held.items():
        assert text.count(now) == 1
        text = text.replace(now, before)
    (tmp_path / "case.toml").write_text(text)
    assert load(tmp_path / "case.toml") == case
    assert load(tmp_path / "case.toml").to_toml() == case.to_toml()


def test_what_is_not_used_sets_no_radius():
    """The default of a radius that nothing is summed with is no neighbour's distance."""
    narrow = {
        slot: type(scheme).model_validate({"re": 1.5})
        for slot, scheme in ((slot, getattr(PredictMoveProject(), slot)) for slot in PredictMoveProject.model_fields)
        if isinstance(scheme, Operator) and "re" not in scheme.unused
    }
    viscosity = type(PredictMoveProject().viscosity)(laplacian={"name": "original", "re": 1.5})
    step = PredictMoveProject(**narrow, viscosity=viscosity)
    assert any(isinstance(s, LowNumberDensity) and s.re == 2.1 for s in nested(step))
    assert step.largest_radius() == 1.5


@pytest.mark.parametrize(("step", "other"), [(ProjectInPlace, "zero"), (PredictMoveProject, "half-cell")])
def test_a_surface_pressure_that_nobody_takes_is_refused(step, other):
    for key, known in (("imaged", False), ("detection-free", False), ("blended", True), ("umbrella", True)):
        source = {} if step is ProjectInPlace else {"source": "divergence"}
        assert step(free_surface=key, **source)
        if known:
            assert step(free_surface=key, surface_pressure=other, **source)
        else:
            with pytest.raises(CaseError, match=f"surface_pressure has no effect with free_surface '{key}'"):
                step(free_surface=key, surface_pressure=other, **source)
