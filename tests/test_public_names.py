"""Every public name is documented: what it is, in which unit, of which shape, what it raises, from which source.

Public is what no underscore hides, in every module of the package: classes, functions, methods, properties, and the
parameters of schemes, bodies, shapes, gauges, motions and of the case. ``python tests/test_public_names.py`` prints
the count and what is missing.
"""

import ast
import importlib
import inspect
import pkgutil
import re
import sys
import textwrap
import typing
from collections import Counter
from dataclasses import dataclass, is_dataclass

import pytest
from numpy.typing import NDArray

import spume
from spume.citation import bibliography
from spume.named import Parameters, Scheme, attribute_docs, load_all

FORMULAS = ("spume.schemes.", "spume.steps.", "spume.wall_models.", "spume.pressure.")
"""Where functions are the lines of a formula, which the docstring of their class states (see pyproject.toml)."""

NOT_ERRORS = {"NotImplementedError", "AssertionError", "PydanticCustomError"}
"""Raised where a family has no default, and inside validators, which turn them into messages."""

UNIT = re.compile(r"\[[^\]\n]+\]|\bSI units?\b|\bin metres\b|\bpixels?\b|\bunit of the reference\b|\bthe reference's\b")


@dataclass(frozen=True)
class Claim:
    """Something that a docstring must say."""

    name: str
    kind: str
    said: bool


def modules():
    """Yield every module that belongs to the package and has no underscore."""
    load_all()
    yield spume
    for module in pkgutil.walk_packages(spume.__path__, "spume."):
        if not any(part.startswith("_") for part in module.name.split(".")):
            yield importlib.import_module(module.name)


def own(module):
    """Yield name and object of the classes and functions that a module defines and does not hide."""
    for name, thing in vars(module).items():
        if name.startswith("_") or getattr(thing, "__module__", None) != module.__name__:
            continue
        if inspect.isclass(thing) or inspect.isfunction(thing):
            yield name, thing


def members(cls):
    """Yield name and function of the methods and properties that a class defines and does not hide."""
    for name, thing in vars(cls).items():
        if (name.startswith("_") and name != "__call__") or name == "model_post_init":  # pydantic's hook
            continue
        if isinstance(thing, property):
            yield name, thing.fget
        elif isinstance(thing, staticmethod | classmethod):
            yield name, thing.__func__
        elif hasattr(thing, "func") and inspect.isfunction(thing.func):  # cached_property
            yield name, thing.func
        elif inspect.isfunction(thing):
            yield name, thing


def documentation(cls, name, function):
    """Return what the method says, or the method that it overrides, and its class."""
    texts = [function.__doc__ or ""]
    texts += [getattr(vars(base).get(name), "__doc__", "") or "" for base in cls.__mro__[1:]]
    return next((text for text in texts if text.strip()), ""), "\n".join(filter(None, [*texts, cls.__doc__ or ""]))


def raised(function):
    """Return the exceptions that a function raises itself, beside those that say that a family has no default."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    except (OSError, TypeError, SyntaxError):
        return set()
    found = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call):
            called = node.exc.func
            found.add(called.id if isinstance(called, ast.Name) else getattr(called, "attr", ""))
    return {name for name in found if name[:1].isupper()} - NOT_ERRORS


def has_array(function):
    """Whether a function takes or returns arrays, as its annotations say."""
    annotations = inspect.get_annotations(function).values()
    return any(re.search(r"ndarray|\bPoints\b", str(annotation), re.IGNORECASE) for annotation in annotations)


def of_function(name, function, text, context):
    """Yield what the documentation of a function must say."""
    yield Claim(name, "docstring", bool(text.strip()))
    if has_array(function):
        yield Claim(name, "shapes", "shape" in context)
    if raised(function) and not name.startswith("spume.cli."):  # a command ends with an exit code
        yield Claim(name, "errors", bool(re.search(r"\bRaises?\b|\bRefuse", text)))


def holds_numbers(annotation):
    """Whether a parameter is a real number or some of them: a physical quantity."""
    if annotation is float:
        return True
    return any(holds_numbers(part) for part in typing.get_args(annotation) if part is not None)


def of_parameters(name, cls):
    """Yield what the documentation of a class's own parameters must say."""
    docs = attribute_docs(cls)
    for key in cls.__annotations__:
        if key not in cls.model_fields:
            continue
        text = docs.get(key, "")
        yield Claim(f"{name}.{key}", "docstring", bool(text))
        if holds_numbers(cls.model_fields[key].annotation):
            yield Claim(f"{name}.{key}", "unit", bool(UNIT.search(text)))


def of_attributes(name, cls):
    """Yield that each attribute of a dataclass is named in its docstring, or has a text of its own."""
    source = inspect.getsource(cls)
    for key in inspect.get_annotations(cls):
        if not key.startswith("_"):
            alone = re.search(rf'^    {key}: .*\n    """', source, re.MULTILINE)
            named = re.search(rf"\b{key}\b", cls.__doc__ or "")
            yield Claim(f"{name}.{key}", "docstring", bool(alone or named))


def claims():
    """Yield everything that must be said."""
    for module in modules():
        yield Claim(module.__name__, "docstring", bool((module.__doc__ or "").strip()) or module.__name__ == "spume")
        for name, thing in own(module):
            path = f"{module.__name__}.{name}"
            if inspect.isfunction(thing):
                if not module.__name__.startswith(FORMULAS):
                    yield from of_function(path, thing, thing.__doc__ or "", thing.__doc__ or "")
                continue
            yield Claim(path, "docstring", bool((thing.__doc__ or "").strip()))
            if issubclass(thing, Parameters):
                yield from of_parameters(path, thing)
            elif is_dataclass(thing):
                yield from of_attributes(path, thing)
            if issubclass(thing, Scheme) and thing.key and thing.key != "none" and module.__name__.startswith(FORMULAS):
                keys = thing.publications()
                said = set(keys) <= set(bibliography()) if keys else "This project" in (thing.__doc__ or "")
                yield Claim(path, "source", said)
            for key, function in members(thing):
                text, context = documentation(thing, key, function)
                yield from of_function(f"{path}.{key}", function, text, context)
    for name in spume.__all__:
        thing = getattr(spume, name)
        yield Claim(f"spume.{name}", "docstring", isinstance(thing, str) or bool((thing.__doc__ or "").strip()))


def report():
    """Return what is missing, and the count as lines of text."""
    found = list(dict.fromkeys(claims()))
    total, said = Counter(c.kind for c in found), Counter(c.kind for c in found if c.said)
    lines = [f"{kind}: {said[kind]} of {total[kind]}" for kind in sorted(total)]
    names = len({c.name for c in found})
    lines.append(f"all: {sum(said.values())} of {len(found)} for {names} public names")
    return [f"{c.name}: {c.kind}" for c in found if not c.said], lines


def test_every_public_name_is_documented():
    missing, lines = report()
    print("\n".join(lines))  # noqa: T201
    assert missing == []


class Undocumented(Parameters):
    depth: float
    """How deep it is."""
    width: float


def undocumented(x: NDArray) -> float:
    """Return something."""
    if not len(x):
        raise ValueError("nothing")
    return 1.0


def documented(x: NDArray) -> float:
    """Return the sum of values, shape (n,).

    Raises:
        ValueError: no values.
    """
    if not len(x):
        raise ValueError("nothing")
    return 1.0


@pytest.mark.parametrize(
    ("found", "missing"),
    [
        (lambda: of_parameters("a", Undocumented), ["a.depth: unit", "a.width: docstring", "a.width: unit"]),
        (lambda: of_function("b", undocumented, *2 * (undocumented.__doc__,)), ["b: shapes", "b: errors"]),
        (lambda: of_function("c", documented, *2 * (documented.__doc__,)), []),
        (lambda: of_function("d", lambda: 0, "", ""), ["d: docstring"]),
    ],
)
def test_what_is_missing_is_seen(found, missing):
    assert [f"{claim.name}: {claim.kind}" for claim in found() if not claim.said] == missing


if __name__ == "__main__":
    absent, count = report()
    print("\n".join([*absent, *count]))  # noqa: T201
    sys.exit(bool(absent))
