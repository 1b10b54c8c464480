"""spume new-scheme: what it writes works at once, for every family."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner

from spume import named
from spume.cli import app
from spume.cli.new_scheme import claims_entry, skeleton

named.load_all()
MODELS = {s.key: s for s in named.schemes("gradient")}


@pytest.fixture
def call(monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    return lambda *words: CliRunner().invoke(app, ["new-scheme", *map(str, words)])


def families():
    return sorted({s.family for s in named.schemes() if s.__module__.startswith("spume.schemes.")})


def test_a_skeleton_of_every_family_is_a_scheme(call, tmp_path):
    """Each is written outside the package, as a package of its own would have it, and imported there."""
    for family in families():
        result = call(family, "my-own", "--out", tmp_path / f"my_{family}.py")
        assert result.exit_code == 0, result.output
        assert 'entry-points."spume.schemes"' in result.output
    modules = ", ".join(f"my_{family}" for family in families())
    code = (
        f"import {modules}; from spume import named; print(*(s.family for s in named.schemes() if s.key == 'my-own'))"
    )
    answer = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert answer.stdout.split() == families()


def test_the_copy_claims_no_id_and_says_what_to_write():
    text = (
        '"""Old."""\nfrom a import X\n\n\nclass Original(X, name="original"):\n    """Old\n    lines."""\n\n'
        '    ids: ClassVar = ("B1",)\n    reference: ClassVar = "a"\n    order: ClassVar = 0\n\n\n'
        'class Second(Original, name="second"):\n    """Another."""\n'
    )
    found = skeleton(text, MODELS["original"], "my-own-2")
    assert 'class MyOwn2(X, name="my-own-2"):' in found
    assert "B1" not in found
    assert "Old" not in found
    assert "Second" not in found
    assert "order: ClassVar = 0" in found
    compile(found, "skeleton", "exec")


@pytest.mark.parametrize(
    ("family", "key", "line"),
    [
        ("laplacian", "original", '"koshizuka1996"'),
        ("laplacian", "higher-order", '("khayyer2010", "khayyer2012")'),
        ("weight", "isochoric", "()"),
    ],
)
def test_the_copy_names_the_publications_of_what_it_still_is(family, key, line):
    model = named.find(family, key)
    text = Path(sys.modules[model.__module__].__file__).read_text(encoding="utf-8")
    expected = f"    reference: ClassVar = {line}  # its own key in src/spume/references.bib\n"
    assert expected in skeleton(text, model, "my-own")


def test_its_claims_are_those_of_the_model_it_starts_from():
    text = (
        '[gradient.original]\nids = ["B1"]\norder = 0\nvalue = { "2D" = 1.0 }\n\n'
        '[gradient.other]\nids = ["B2"]\nloop = """\ndef other(cloud):\n"""\nvalue = { "2D" = 2.0 }\n'
    )
    entry = tomllib.loads(claims_entry(text, MODELS["original"], "my-own"))["gradient"]["my-own"]
    assert entry == {"ids": [], "order": 0, "value": {"function": "original", "2D": 1.0}}


def test_in_a_clone_it_writes_the_file_and_the_entry(call, tmp_path, monkeypatch):
    claims = tmp_path / "claims.toml"
    claims.write_text('[gradient.original]\nids = ["B1"]\norder = 0\nvalue = { "2D" = 1.0 }\n')
    folder = tmp_path / "src" / "spume" / "schemes" / "gradient"
    folder.mkdir(parents=True)
    original = MODELS["original"]
    module = sys.modules[original.__module__]
    (folder / "original.py").write_text(Path(module.__file__).read_text(encoding="utf-8"))
    monkeypatch.setattr(module, "__file__", str(folder / "original.py"))
    (tmp_path / "tests").mkdir()
    claims = claims.rename(tmp_path / "tests" / "claims.toml")
    result = call("gradient", "my-own")
    assert result.exit_code == 0, result.output
    assert (folder / "my_own.py").exists()
    assert list(tomllib.loads(claims.read_text())["gradient"]) == ["original", "my-own"]
    again = call("gradient", "my-own")
    assert again.exit_code == 2
    assert "nothing is overwritten" in again.output


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("gradent", "x"), "did you mean 'gradient'?"),
        (("gradient", "X_y"), "small letters, digits and single hyphens"),
        (("gradient", "original"), "a gradient of that name already"),
        (("gradient", "x", "--from", "corected"), "did you mean 'corrected'?"),
    ],
)
def test_bad_input(call, words, message):
    result = call(*words)
    assert result.exit_code == 2
    assert message in " ".join(result.output.replace("│", " ").split()), (
        "the words, wherever the frame breaks the lines"
    )
