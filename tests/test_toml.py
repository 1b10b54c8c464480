"""TOML: lines of keys, values of the command line, writing."""

import math
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from spume import toml

DOCUMENT = '''\
title = "a = [b]"  # [x]
# spacing = 3
spacing = 0.01

[time]
end = 1.0
"odd key" = """
[fake]
fake = 1
"""

[[fluid]]
name = 'water' # ]]
shape = { kind = "box", lower = [0.0,
  1.0], inner = { deep = true } }

[[fluid]]
name = "oil"
shape.kind = "sphere"

[fluid.extra]
a = [
  1,  # one
  { b = 2 },
]
'''


@pytest.mark.parametrize(
    ("path", "line"),
    [
        (("title",), 1),
        (("spacing",), 3),
        (("time",), 5),
        (("time", "end"), 6),
        (("time", "odd key"), 7),
        (("fluid",), 12),
        (("fluid", 0), 12),
        (("fluid", 0, "name"), 13),
        (("fluid", 0, "shape", "lower", 1), 15),
        (("fluid", 0, "shape", "inner", "deep"), 15),
        (("fluid", 1), 17),
        (("fluid", 1, "shape"), 19),
        (("fluid", 1, "shape", "kind"), 19),
        (("fluid", 1, "extra"), 21),
        (("fluid", 1, "extra", "a", 1, "b"), 24),
    ],
)
def test_lines_of_keys(path, line):
    assert toml.key_lines(DOCUMENT)[path] == line


def test_no_line_for_what_is_not_there():
    lines = toml.key_lines(DOCUMENT)
    assert not [path for path in lines if "fake" in path]
    assert toml.key_lines(DOCUMENT.replace("\n", "\r\n")) == lines


SCALARS = (
    st.booleans()
    | st.integers(-(2**53), 2**53)
    | st.floats(allow_nan=False, allow_subnormal=False)  # kernels flush subnormal numbers to zero
    | st.text(st.characters(exclude_categories=["Cs"]), max_size=12)
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=3) | st.dictionaries(st.text('ab-_ .é"', min_size=1, max_size=4), inner, max_size=3)
    ),
    max_leaves=12,
)
DOCUMENTS = st.dictionaries(st.text('abc-_ "', min_size=1, max_size=5), VALUES, max_size=5)


@given(DOCUMENTS)
def test_what_is_written_is_read_back(document):
    assert tomllib.loads(toml.dumps(document)) == document


def paths(node, at=()):
    if at:
        yield at
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, value in items:
        yield from paths(value, (*at, key))


@given(DOCUMENTS)
def test_every_key_that_is_written_has_a_line(document):
    lines = toml.key_lines(toml.dumps(document))
    quoted = {p for p in paths(document) if any(isinstance(k, str) and ('"' in k or "\\" in k) for k in p)}
    assert set(paths(document)) - quoted <= set(lines)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1", 1),
        ("1e-3", 1e-3),
        ("true", True),
        ("[0, -9.81]", [0, -9.81]),
        ('"a b"', "a b"),
        ("free-slip", "free-slip"),
        ("1\nspacing = 2", "1\nspacing = 2"),
        ("", ""),
        ('{ kind = "box" }', {"kind": "box"}),
    ],
)
def test_values_of_the_command_line(text, value):
    assert toml.read_value(text) == value


def test_numbers_that_are_none():
    assert toml.literal(math.inf) == "inf"
    assert toml.literal(-math.inf) == "-inf"
    assert toml.literal(math.nan) == "nan"
    with pytest.raises(TypeError):
        toml.literal(object())
