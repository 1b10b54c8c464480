"""What to cite: complete, each source once, of what the case really uses."""

import json
import re

import pytest
from typer.testing import CliRunner

import spume
from spume.citation import bibliography
from spume.cli import app


def keys(text):
    return re.findall(r"^@\w+\{([^,\s]+),", text, re.MULTILINE)


def test_entries_are_those_of_the_models_that_the_case_selects():
    text = spume.cite("dam-break")
    found = keys(text)
    assert found[:2] == ["spume", "koshizuka1996"]
    assert len(found) == len(set(found))
    assert {"cummins1999", "sodersten2019", "liu2018", "lobovsky2014"} <= set(found)
    assert "duan2019" not in found
    other = spume.load("dam-break", ["step.gradient=second-order"])
    assert "duan2019" in keys(spume.cite(other))
    assert "% gradient 'second-order'" in spume.cite(other)
    assert all(bibliography()[key] in text for key in found[1:])
    assert text.count("{") == text.count("}")


def test_a_scheme_within_a_scheme_is_cited():
    case = spume.load("dam-break", ["step.viscosity.turbulence=smagorinsky", "step.number_density.weight=wendland"])
    assert {"smagorinsky1963", "wendland1995"} <= set(keys(spume.cite(case)))


def cited(*overrides):
    return keys(spume.cite(spume.load("dam-break", overrides)))


@pytest.mark.parametrize(
    ("override", "key"),
    [
        ("step.laplacian='higher-order'", "khayyer2010"),
        ("step.laplacian='higher-order'", "khayyer2012"),
        ("step.viscosity.turbulence='smagorinsky'", "pan2012"),
        ("step='weakly-compressible'", "antuono2010"),
        ("step.shifting='fickian-along-surface'", "xu2009"),
        ("step.shifting='fickian-along-surface'", "lind2012"),
        ("spacing=0.006", "lee2011"),  # of any case with walls
    ],
)
def test_every_publication_of_a_model_is_cited(override, key):
    assert key in cited("step.collision='none'", override)


@pytest.mark.parametrize(
    ("step", "key"),
    [
        ("{name='predict-move-project', source={name='density', compressibility=C}}", "ikeda2001"),
        ("{name='predict-move-project', source={name='three-term', compressibility=C}}", "khayyer2016"),
        ("{source={name='divergence-density', compressibility=C}}", "khayyer2016"),
    ],
)
def test_compressibility_is_cited_where_there_is_one(step, key):
    assert key in cited("step=" + step.replace("C", "4.5e-10"))
    assert not {"ikeda2001", "khayyer2016"} & set(cited("step=" + step.replace("C", "0.0")))


def test_models_of_this_project_are_not_ascribed_to_others():
    """What is cited is what a model comes from; Spume itself always is."""
    others = "viscosity='none', shifting='none', collision='none', wall_model='resting', source='divergence'"
    plain = f"step={{name='project-in-place', {others}}}"
    text = spume.cite(spume.load("hydrostatic", [plain]))
    for what in ("free surface 'imaged'", "gradient 'imaged'", "weight 'isochoric'"):
        assert what not in text
    assert not {"liu2018", "pan2008"} & set(keys(text))
    assert "divergence 'bounded'" in text, "the matrix of Khayyer & Gotoh"


def test_a_run_is_cited_with_the_version_that_computed_it(tmp_path):
    folder = tmp_path / "run"
    folder.mkdir()
    (folder / "case.toml").write_text(spume.load("hydrostatic").to_toml(), encoding="utf-8")
    assert f"Version {spume.__version__}," in spume.cite(folder)
    (folder / "summary.json").write_text(json.dumps({"version": "0.0.7"}), encoding="utf-8")
    result = CliRunner().invoke(app, ["cite", str(folder), "--out", str(tmp_path / "a.bib")])
    assert result.exit_code == 0, result.output
    text = (tmp_path / "a.bib").read_text(encoding="utf-8")
    assert "Version 0.0.7," in text
    assert text == spume.cite(folder)


@pytest.mark.parametrize(
    ("what", "message"), [("dam-brek", "did you mean 'dam-break'?"), (".", "no run folder: it holds no case.toml")]
)
def test_what_is_no_run_is_named(what, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = CliRunner().invoke(app, ["cite", what])
    assert (result.exit_code, message in " ".join(result.output.split())) == (2, True)
    with pytest.raises(spume.CaseError):
        spume.cite(what)


def test_only_what_has_a_case_can_be_cited():
    with pytest.raises(TypeError, match="int: a run folder"):
        spume.cite(3)
