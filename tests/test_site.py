"""The pages that are generated are what would be generated now, and describe every key and option there is."""

import re
import shlex
import sys
from pathlib import Path

import pytest
import typer

from pages import check_options
from spume.case import schema
from spume.cli import app

DOCS = Path(__file__).parents[1] / "docs"
sys.path.append(str(DOCS))

pytestmark = pytest.mark.skipif(not (DOCS / "keys.py").exists(), reason="no docs folder beside the tests")


def test_the_reference_is_what_the_code_says():
    import generate_reference

    assert generate_reference.stale() == [], "run python docs/generate_reference.py"


@pytest.mark.skipif(not (DOCS.parent / "validation").exists(), reason="no validation folder beside the tests")
def test_the_gallery_is_what_the_validation_says():
    import generate_gallery

    assert not generate_gallery.stale(), "run python docs/generate_gallery.py"


def models():
    """Yield name and JSON Schema of every table of a case file."""
    whole = schema()
    yield "case", whole
    for name, definition in whole["$defs"].items():
        for model in definition.get("anyOf", [definition]):
            if "properties" in model:
                yield f"{name} {model['title']}", model


def test_every_key_has_a_meaning_and_every_number_a_unit():
    import keys

    lacking = []
    for name, model in models():
        for key, node in model["properties"].items():
            if "const" in node:
                continue
            cells = re.split(r" (?<!\\)\| ", keys.row(key, node, required=False).strip("| "))
            assert len(cells) == 6, cells
            kind, unit, meaning = cells[1], cells[2], cells[5]
            if not meaning or ("number" in kind and unit == "–"):
                lacking.append(f"{name}: {key}")
    assert lacking == []


def test_every_option_of_the_command_line_is_one():
    text = (DOCS / "reference" / "command-line.md").read_text("utf-8")
    sections = dict(re.findall(r"^## `spume ([\w-]+)`\n(.*?)(?=^## |\Z)", text, re.MULTILINE | re.DOTALL))
    commands = typer.main.get_command(app).commands
    assert sorted(sections) == sorted(name for name, command in commands.items() if not command.hidden)
    for name, section in sections.items():
        printed = set(re.findall(r"`(-[\w-]+)`", section))
        there = {o for p in commands[name].params for o in (*p.opts, *p.secondary_opts) if o.startswith("-")}
        assert printed == there - {"--help", "-h"}, name


def test_the_examples_of_the_command_line_are_understood():
    text = (DOCS / "reference" / "command-line.md").read_text("utf-8")
    examples = re.findall(r"^    spume (.*)$", text, re.MULTILINE)
    assert len(examples) > 5
    for example in examples:
        check_options(shlex.split(example.split(" > ")[0]))


def test_every_citation_of_the_theory_is_among_the_publications():
    text = re.sub(r"\s+", " ", (DOCS / "theory.md").read_text("utf-8"))
    sources = (DOCS / "reference" / "sources.md").read_text("utf-8")
    citations = re.findall(r"([A-Z][\w-]+)(?: et al\.| & [\w ]+?|, [A-Z]\w+ & [A-Z]\w+)? \(?((?:19|20)\d\d)", text)
    assert len(citations) > 20
    missing = {f"{name} {year}" for name, year in citations if not re.search(rf"{name}.*\({year}\)", sources)}
    assert missing == set()


@pytest.mark.skipif(not (DOCS.parent / "mkdocs.yml").exists(), reason="no mkdocs.yml beside the tests")
def test_every_page_is_in_the_navigation():
    navigation = (DOCS.parent / "mkdocs.yml").read_text("utf-8")
    names = [path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")]
    assert [name for name in names if f": {name}\n" not in navigation] == []
