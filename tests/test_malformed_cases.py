"""Broken cases, made by mutating the built-in ones: each is refused with a message, or is in order.

Nothing is computed: a case is read, its rows are made, its gauges are looked at and its cost is predicted, which is
what `spume check` does and what every run does first. The examples are the same in every run of the tests.
"""

import copy
import math
import re
import tempfile
import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from spume import build, toml
from spume.case import CaseError, built_in_cases, load
from spume.particles import FLUID
from spume.prediction import predict

COARSE = {
    "couette": 0.1,
    "dam-break": 0.05,
    "dam-break-3d": 0.05,
    "dam-break-martin-moyce": 0.01143,
    "hydrostatic": 0.1,
    "hydrostatic-3d": 0.1,
    "poiseuille": 0.1,
    "standing-wave": 0.1,
    "taylor-green": 0.1,
}
"""Spacings [m] that keep the cases small; another case keeps its own."""

EXAMPLES = settings(
    derandomize=True,
    database=None,
    deadline=None,
    phases=[Phase.generate],
    suppress_health_check=list(HealthCheck),
)


def documents():
    found = {}
    for name, path in built_in_cases().items():
        text = path.read_text(encoding="utf-8")
        document = tomllib.loads(text)
        document["spacing"] = COARSE.get(name, document["spacing"])
        if all(item.get("kind") not in ("stl", "extrusion") for item in document.get("body", ())):
            found[name] = document
    return found


DOCUMENTS = documents()

POSITIVE = {"spacing", "end", "courant", "density", "interval", "time_scale", "radius", "wavelength", "speed"}
"""Keys whose value must be greater than zero."""
REQUIRED = {
    (): {"spacing", "time", "fluid"},
    ("time",): {"end"},
    ("fluid", 0): {"name", "shape"},
    ("fluid", 0, "shape"): {"kind", "lower", "upper"},
    ("body", 0): {"name", "kind", "shape"},
    ("body", 0, "shape"): {"kind", "lower", "upper"},
    ("gauge", 0): {"name", "kind"},
    ("reference", 0): {"gauge", "file"},
}
"""Tables whose keys cannot be left out."""
BEYOND = [1e300, -1e300, 1e-300, -1e-300, 5e-324, 1e18, -1e18, 1e9, -1e9, 1e-12, 2**63, 10**400, -(10**400)]
OTHERS = [True, 0, -1, 1.5, "", "0.1", "nonsense", [], [[]], {}, [1], ["x"], {"a": 1}, [0.0, 0.0], [0.0, 0.0, 0.0], "/"]
JUNK = ["é", "水", "\u202e", "a\nb", "\t", "💧", "{}", "%s", "x" * 5000, "../../etc/passwd", "/etc/passwd", "a\0b"]


# ------------------------------------------------------------------------------------------ mutations


def paths(node, path=()):
    """Yield the path of every key and every element of a document."""
    items = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, value in items:
        yield (*path, key)
        yield from paths(value, (*path, key))


def at(document, path):
    for part in path:
        document = document[part]
    return document


def is_number(value):
    return isinstance(value, int | float) and not isinstance(value, bool)


def chosen(draw, document, accept):
    """Return one path of the document whose last key and value are accepted, None where there is none."""
    found = [path for path in paths(document) if accept(path, at(document, path))]
    return draw(st.sampled_from(found)) if found else None


def replaced(document, path, value):
    at(document, path[:-1])[path[-1]] = copy.deepcopy(value)
    return path


def renamed(table, old, new):
    """Replace a key, in its place."""
    items = [(new if key == old else key, value) for key, value in table.items()]
    table.clear()
    table.update(items)


def drop(draw, document):
    """A required key is missing."""

    def required(path, value):
        return path[-1] in REQUIRED.get(path[:-1], ())

    path = chosen(draw, document, required)
    if path is not None:
        del at(document, path[:-1])[path[-1]]
        return ()
    return None


def misspell(draw, document):
    """A key that does not exist."""
    path = chosen(draw, document, lambda path, value: isinstance(path[-1], str))
    key, i = path[-1], draw(st.integers(0, len(path[-1]) - 1))
    spellings = [key + "s", key[:i] + "q" + key[i:], key.upper(), key.replace("e", "е"), f"{key} ", ""]
    wrong = draw(st.sampled_from(spellings))
    if wrong in (key, *at(document, path[:-1])):
        wrong = key + "_"
    renamed(at(document, path[:-1]), key, wrong)
    return (*path[:-1], wrong)


def wrong_type(draw, document):
    """A value of a type that nothing takes there."""
    path = chosen(draw, document, lambda path, value: True)
    old = at(document, path)
    if is_number(old):
        value = draw(st.sampled_from([str(old), "a", True, [], [old], {}, {"value": old}]))
    elif isinstance(old, str):
        value = draw(st.sampled_from([1, 1.5, False, [1], [[]], {"nonsense": 1}]))
    elif isinstance(old, list):
        value = draw(st.sampled_from([1, 0.5, True, "nonsense", {"nonsense": 1}]))
    else:
        value = draw(st.sampled_from([1, 0.5, True, "nonsense", [1], [[]], []]))
    return replaced(document, path, value)


def not_a_number(draw, document):
    """NaN or infinity."""
    path = chosen(draw, document, lambda path, value: is_number(value))
    return replaced(document, path, draw(st.sampled_from([math.nan, math.inf, -math.inf])))


def not_positive(draw, document):
    """Zero or a negative number where only positive ones have a meaning."""
    path = chosen(draw, document, lambda path, value: path[-1] in POSITIVE and is_number(value))
    return replaced(document, path, draw(st.sampled_from([0, 0.0, -0.0, -1, -at(document, path), -1e300])))


def impossible_size(draw, document):
    """A spacing that gives no particle at all, or more than any memory holds."""
    replaced(document, ("spacing",), draw(st.sampled_from([1e300, 1e18, 1e6, 1e-9, 1e-12, 1e-300, 5e-324])))
    return ()


def unknown_scheme(draw, document):
    """A name that no scheme has."""
    path = chosen(draw, document, lambda path, value: path[-1] == "kind" or path == ("step", "name"))
    return replaced(document, path, draw(st.sampled_from(["nonsense", at(document, path) + "x", "", *JUNK])))


def unknown_slot(draw, document):
    """A scheme of the step by a name that its family does not have."""
    slot = draw(st.sampled_from(["gradient", "divergence", "laplacian", "source", "shifting", "solver", "viscosity"]))
    document.setdefault("step", {"name": "project-in-place"})[slot] = "nonsense"
    return ("step", slot)


def other_dimension(draw, document):
    """Vectors of another length than the case has dimensions."""
    document["dimension"] = 5 - document.get("dimension", 2)
    return ()


def another_axis(draw, document):
    """A corner with one number more or less."""
    path = chosen(draw, document, lambda path, value: path[-1] in ("lower", "upper") and isinstance(value, list))
    if path is None:
        return None
    value = at(document, path)
    replaced(document, path, draw(st.sampled_from([value[:-1], [*value, 1.0], []])))
    return path[:-1]


def upside_down(draw, document):
    """Lower and upper corner exchanged, or a shape without extent."""
    boxes = lambda path, value: isinstance(value, dict) and "upper" in value and path[0] != "reference"  # noqa: E731
    path = chosen(draw, document, boxes)
    if path is None:
        return None
    table = at(document, path)
    if draw(st.booleans()):
        table["lower"], table["upper"] = table["upper"], table["lower"]
    else:
        table["upper"] = table["lower"]
    return path


def same_place(draw, document):
    """A second fluid where the first one is."""
    second = copy.deepcopy(document["fluid"][0])
    second["name"] = "second"
    document["fluid"].append(second)
    return ("fluid", 1, "shape")


def into_the_wall(draw, document):
    """A fluid that starts two spacings below its floor."""
    bodies = [body for body in document.get("body", ()) if "bottom" not in body["shape"].get("open", ())]
    if not bodies:
        return None
    document["fluid"][0]["shape"]["lower"][-1] -= 2 * document["spacing"]
    return ("fluid", 0, "shape")


def same_name(draw, document):
    """Two fluids, bodies or gauges of one name."""
    path = chosen(draw, document, lambda path, value: len(path) == 2 and path[0] in ("fluid", "body", "gauge"))
    document[path[0]].append(copy.deepcopy(at(document, path)))
    return (path[0], len(document[path[0]]) - 1, "name")


def gauge_outside(draw, document):
    """A gauge where no water can come."""
    path = chosen(draw, document, lambda path, value: path[0] == "gauge" and path[-1] == "at")
    bounded = document.get("body") or document.get("domain", {}).get("periodic")
    if path is None or not bounded:  # a liquid without walls may go anywhere
        return None
    at(document, path)[0] += draw(st.sampled_from([-100.0, 100.0, 1e300]))
    return path


def unknown_gauge(draw, document):
    """A reference for a gauge, a column or a file that is not there."""
    path = chosen(draw, document, lambda path, value: path[0] == "reference" and path[-1] in ("gauge", "file"))
    if path is None:
        return None
    return replaced(document, path, draw(st.sampled_from(["nonsense", "", *JUNK[:-4], "no/such/file.csv", "/"])))


def wrong_nesting(draw, document):
    """A table where an array of tables belongs, or the other way round, or all of it one level down."""
    choice = draw(st.sampled_from(["array", "table", "down"]))
    if choice == "down":
        inner = dict(document)
        document.clear()
        document["case"] = inner
        return ("case",)
    kind = dict if choice == "array" else list
    path = chosen(draw, document, lambda path, value: len(path) == 1 and isinstance(value, kind) and value)
    if path is None:
        return None
    return replaced(document, path, [at(document, path)] if choice == "array" else at(document, path)[0])


REFUSED = [
    drop,
    misspell,
    wrong_type,
    not_a_number,
    not_positive,
    impossible_size,
    unknown_scheme,
    unknown_slot,
    other_dimension,
    another_axis,
    upside_down,
    same_place,
    into_the_wall,
    same_name,
    gauge_outside,
    unknown_gauge,
    wrong_nesting,
]
"""Mutations after which no case is in order; each returns where it was, or None where it does not apply."""


def anything(draw, document):
    """Any value anywhere."""
    path = chosen(draw, document, lambda path, value: True)
    if path is None:
        return
    old = at(document, path)
    more = [old * factor for factor in (0.5, 2.0, -1.0, 10.0)] if is_number(old) and abs(old) < 1e300 else []
    replaced(document, path, draw(st.sampled_from([*BEYOND, *OTHERS, *JUNK, *more])))


def drop_anything(draw, document):
    """A key or an element that is missing."""
    path = chosen(draw, document, lambda path, value: True)
    if path is not None:
        del at(document, path[:-1])[path[-1]]


def move(draw, document):
    """A value of one place at another."""
    here, there = (chosen(draw, document, lambda path, value: True) for _ in range(2))
    if here is not None and there is not None:
        replaced(document, here, copy.deepcopy(at(document, there)))


# ------------------------------------------------------------------------------------------------ oracle


@pytest.fixture(scope="module", autouse=True)
def _small_machine():
    """A machine of 256 MiB, so that a case too large is refused and not tried."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(build, "memory", lambda: 1 << 28)
        yield


@pytest.fixture(scope="module")
def folder():
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)


def verdict(content, folder):
    """Return the CaseError of a file's content, None where the case is in order."""
    file = folder / "broken.toml"
    file.write_bytes(content)
    try:
        case = load(file)
        rows = build.initial_rows(case)
        build.check_gauges(case, rows)
        predicted = predict(case, rows, 2)
    except CaseError as error:
        for problem in error.problems:
            assert str(problem).startswith(str(file)), problem
            assert problem.message
            assert "\n" not in str(problem), problem
            assert not re.search(r"pydantic|Traceback|validat|NoneType|object at 0x", problem.message), problem
        return error
    assert (rows["kind"] == FLUID).any()
    for name, values in rows.items():
        assert np.isfinite(values).all(), name
    assert rows["density"].min() > 0.0
    assert math.isfinite(predicted.seconds)
    assert predicted.steps >= 1
    return None


def text_of(document):
    return toml.dumps(document).encode()


@pytest.mark.parametrize("name", DOCUMENTS)
def test_what_is_mutated_is_in_order(name, folder):
    assert verdict(text_of(DOCUMENTS[name]), folder) is None


@pytest.mark.parametrize("mutation", REFUSED, ids=lambda mutation: mutation.__name__)
def test_what_must_be_refused_is_refused_where_it_stands(mutation, folder):
    tried = set()

    @settings(EXAMPLES, max_examples=30)
    @given(st.data())
    def mutated(data):
        document = copy.deepcopy(DOCUMENTS[data.draw(st.sampled_from(list(DOCUMENTS)))])
        path = mutation(data.draw, document)
        if path is None:
            return
        content = text_of(document)
        error = verdict(content, folder)
        assert error is not None, content.decode()
        tried.add(content)
        if path and not (path[0] == "" or "" in path):  # a line was changed: one of the messages names it
            within = {line for key, line in toml.key_lines(content.decode()).items() if key[: len(path)] == path}
            named = {int(found[1]) for p in error.problems if (found := re.search(r"\.toml:(\d+)$", p.where))}
            assert within & named, (path, str(error), content.decode())

    mutated()
    assert len(tried) >= 5


def test_anything_else_is_refused_or_in_order(folder):
    refused = []

    @settings(EXAMPLES, max_examples=300)
    @given(st.data())
    def mutated(data):
        document = copy.deepcopy(DOCUMENTS[data.draw(st.sampled_from(list(DOCUMENTS)))])
        for _ in range(data.draw(st.integers(1, 3))):
            try:
                data.draw(st.sampled_from([*[anything] * 9, drop_anything, move, *REFUSED]))(data.draw, document)
            except (LookupError, TypeError, AttributeError, OverflowError):
                break  # the place of a mutation is gone: the one before took it
        error = verdict(text_of(document), folder)
        refused.append(error is not None)

    mutated()
    assert sum(refused) > 200


def test_text_that_is_damaged_is_refused_or_in_order(folder):
    refused = []

    @settings(EXAMPLES, max_examples=200)
    @given(st.data())
    def damaged(data):
        content = text_of(DOCUMENTS[data.draw(st.sampled_from(list(DOCUMENTS)))])
        place = data.draw(st.integers(0, len(content) - 1))
        length = data.draw(st.integers(1, 40))
        kind = data.draw(st.sampled_from(["cut", "hole", "twice", "binary", "text"]))
        if kind == "cut":
            content = content[:place]
        elif kind == "hole":
            content = content[:place] + content[place + length :]
        elif kind == "twice":
            content = content[: place + length] + content[place:]
        elif kind == "binary":
            content = content[:place] + data.draw(st.binary(min_size=1, max_size=20)) + content[place:]
        else:
            content = content[:place] + data.draw(st.text(min_size=1, max_size=20)).encode() + content[place:]
        refused.append(verdict(content, folder) is not None)

    damaged()
    assert sum(refused) > 100


@pytest.mark.parametrize("name", DOCUMENTS)
def test_a_key_that_stands_twice_is_refused(name, folder):
    lines = text_of(DOCUMENTS[name]).decode().splitlines(keepends=True)
    pairs = [number for number, line in enumerate(lines) if " = " in line]
    for number in pairs:
        content = "".join([*lines[: number + 1], *lines[number:]]).encode()
        error = verdict(content, folder)
        assert error is not None
        assert error.problems[0].where.endswith(f"broken.toml:{number + 2}")
        assert "not TOML" in str(error)


@pytest.mark.parametrize("junk", [b"\xff", b"\x00", b"\x1b[2J", b"\xc3\x28", b"\xed\xa0\x80", b"\x89PNG\r\n\x1a\n\0"])
def test_binary_junk_is_refused(junk, folder):
    content = text_of(DOCUMENTS["dam-break"])
    for place in (0, len(content) // 2, len(content)):
        assert verdict(content[:place] + junk + content[place:], folder) is not None
