"""The documentation says what the package is: systems that are done, names of fields."""

import re
from pathlib import Path

import pytest

import spume.case  # noqa: F401 - defines every family of a case file
from spume.named import load_all, schemes
from spume.particles import BASE_FIELDS
from spume.pressure import matrix

DOCS = Path(__file__).parents[1] / "docs"

pytestmark = pytest.mark.skipif(not DOCS.exists(), reason="no docs folder beside the tests")


def systems() -> dict[str, str]:
    """Return the state of every system in the table, by its id."""
    rows = re.findall(r"^\| ([A-Z]\d+) \|.*\| ([^|]+) \|$", (DOCS / "systems.md").read_text("utf-8"), re.MULTILINE)
    assert len(rows) == len(dict(rows)), "an id stands twice"
    return dict(rows)


def test_every_scheme_has_its_system_marked():
    load_all()
    states = systems()
    claimed = {name for scheme in schemes() for name in scheme.ids}
    assert claimed, "no scheme names a system"
    unmarked = {name for name in claimed if not re.match(r"\*\*done\*\*|in part", states.get(name, "missing"))}
    assert unmarked == set()
    assert {name for name, state in states.items() if state == "**done**"} - claimed == set()


def test_base_fields_are_in_the_notation():
    text = (DOCS / "notation.md").read_text("utf-8")
    assert [field.name for field in BASE_FIELDS if f"`{field.name}`" not in text] == []


def test_states_of_rows_are_in_the_notation():
    text = (DOCS / "notation.md").read_text("utf-8")
    table = text.split("## Rows of a linear system")[1].split("\n\n")[1]
    described = re.findall(r"^\| `([A-Z]+)` \|", table, re.MULTILINE)
    states = {name: value for name, value in vars(matrix).items() if name.isupper() and isinstance(value, int)}
    states = {name: value for name, value in states.items() if value < 4}
    assert sorted(states.values()) == [0, 1, 2, 3]
    assert sorted(described) == sorted(states)


@pytest.mark.skipif(not (DOCS.parent / "validation").exists(), reason="no validation folder beside the tests")
def test_pictures_are_where_the_pages_look_for_them():
    shown = [(page, path) for page in sorted(DOCS.rglob("*.md")) for path in pictures(page)]
    assert len(shown) > 20
    assert [f"{page.name}: {path}" for page, path in shown if not (page.parent / path).exists()] == []


def pictures(page: Path) -> list[str]:
    """Return the paths of the pictures of a page, relative to it."""
    return re.findall(r"!\[[^\]]*\]\(([^)\s:]+)\)", page.read_text("utf-8"))
