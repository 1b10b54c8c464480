"""The shapes of docs/geometry.md can be made as they stand."""

import re
import tomllib
from pathlib import Path

import pytest

import spume
from spume import build
from spume.case import Origin, read

PAGE = Path(__file__).parents[2] / "docs" / "geometry.md"
BLOCKS = re.findall(r"^```toml\n(.*?)^```", PAGE.read_text("utf-8"), re.MULTILINE | re.DOTALL) if PAGE.exists() else []
FAR = {2: ([-2.0, 0.0], [-1.0, 0.5]), 3: ([-2.0, 0.0, 0.0], [-1.0, 0.4, 0.4])}


def dimension(block: str) -> int:
    """Return how many numbers the vectors of a block have."""
    three = re.search(r"\[-?[\d.]+, -?[\d.]+, -?[\d.]+\]|extrusion", block)
    return 3 if three else 2


@pytest.mark.skipif(not BLOCKS, reason="no docs folder beside the tests")
@pytest.mark.parametrize("number", range(len(BLOCKS)))
def test_block(number):
    block = BLOCKS[number]
    d = dimension(block)
    document = {"spacing": 0.04 if d == 3 else 0.02, "dimension": d, "time": {"end": 1.0}, **tomllib.loads(block)}
    lower, upper = FAR[d]
    water = {"name": "w", "shape": {"kind": "box", "lower": lower, "upper": upper}}
    document.setdefault("fluid", [water])
    case = read(document, Origin("page", document))
    rows = build.initial_rows(case)
    for index, body in enumerate(case.body):
        assert (rows["body"] == index).sum() > 50, body.name
    assert spume.case.read(tomllib.loads(case.to_toml()), Origin()) == case


@pytest.mark.skipif(not BLOCKS, reason="no docs folder beside the tests")
def test_every_shape_is_on_the_page():
    spume.named.load_all()
    text = PAGE.read_text("utf-8")
    assert [shape.key for shape in spume.named.schemes("shape") if f"`{shape.key}`" not in text] == []
