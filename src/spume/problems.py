"""What is wrong with a case: one sentence per mistake, with file, line, key and value."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from spume.named import Location, nearest_match
from spume.toml import literal

_LONGEST_VALUE = 60
_ABSENT = object()
_LABELS = ("name", "kind")


@dataclass(frozen=True)
class Problem:
    """One mistake.

    Attributes:
        where: file and line, or the command-line option that gave the value; may be empty.
        key: dotted path of the key.
        value: what was given, as TOML; empty where nothing was.
        message: what is allowed.
    """

    where: str
    key: str
    value: str
    message: str

    def __str__(self) -> str:
        given = self.key + (f" = {self.value}" if self.value else "")
        return ": ".join(part for part in (self.where, given, self.message) if part)


class CaseError(ValueError):
    """A case that cannot be run; `problems` lists every mistake found, `str` gives one per line."""

    def __init__(self, problems: Iterable[Problem]) -> None:
        self.problems = tuple(problems)
        super().__init__("\n".join(map(str, self.problems)))


@dataclass(frozen=True, eq=False)
class Origin:
    """Where the values of a case come from; it is no part of what the case is, so all origins are equal.

    Attributes:
        file: name of the case file, empty for a case made in Python.
        document: what the file and the overrides say.
        lines: line of each key of the file.
        overrides: option that gave each overridden key.
        label: name of the case, after which a run folder is named.
    """

    file: str = ""
    document: Mapping[str, Any] = field(default_factory=dict)
    lines: Mapping[Location, int] = field(default_factory=dict)
    overrides: Mapping[Location, str] = field(default_factory=dict)
    label: str = ""

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Origin)

    def __hash__(self) -> int:
        return 0

    def problem(self, loc: Location, message: str, value: Any = _ABSENT) -> Problem:
        """Return a mistake at a key; where the key is absent, the line of the table that lacks it.

        Without a value, a mistake of a whole table stands at that of its keys which the message names first.
        """
        if value is _ABSENT:
            value = self.value(loc)
            if isinstance(value, Mapping):
                words = re.findall(r"[a-z_]+", message)
                meant = next((word for word in words if word in value and word not in _LABELS), None)
                loc, value = (loc, value) if meant is None else ((*loc, meant), value[meant])
        return Problem(self.where(loc), self.name(loc), shown(value), message)

    def where(self, loc: Location) -> str:
        """Return ``file:line`` or the option that gave the value."""
        for length in range(len(loc), 0, -1):
            if loc[:length] in self.overrides:
                return self.overrides[loc[:length]]
            if loc[:length] in self.lines:
                return f"{self.file}:{self.lines[loc[:length]]}"
        return self.file

    def value(self, loc: Location) -> Any:
        """Return what the case says at a key, or a marker that it says nothing."""
        node: Any = self.document
        for part in loc:
            try:
                node = node[part]
            except (KeyError, IndexError, TypeError):
                return _ABSENT
        return node

    def name(self, loc: Location) -> str:
        """Return the dotted path as ``--set`` takes it; elements of arrays go by their ``name`` if any."""
        parts = []
        for number, part in enumerate(loc):
            node = self.value(loc[: number + 1])
            label = node.get("name") if isinstance(part, int) and isinstance(node, Mapping) else None
            parts.append(label if isinstance(label, str) and label.isprintable() and label else str(part))
        return ".".join(part if part.isprintable() and part else literal(part) for part in parts)

    def problems(self, error: ValidationError, top: Collection[str] = ()) -> list[Problem]:
        """Return the mistakes that validation found, in the order of the file.

        Args:
            top: keys of the outermost table; one that stands inside another table is told its place.
        """
        found = []
        items = error.errors(include_url=False)
        misplaced = {item["loc"] for item in items if item["type"] == "unknown_key" and len(item["loc"]) > 1}
        misplaced = {loc for loc in misplaced if str(loc[-1]) in top}
        for item in items:
            loc = tuple(item["loc"])
            if item["type"] == "missing" and any(loc == other[-1:] for other in misplaced):
                continue
            value = None if item["type"] == "missing" else item["input"]
            if item["type"] == "value_error":  # of a table as a whole
                value = _ABSENT
            message = _message(item)
            if loc in misplaced:
                message = f"no such key here; {_place(str(loc[-1]), item['input'])}"
            found.append((self._order(loc), self.problem(loc, message, value)))
        return [problem for _, problem in sorted(found, key=lambda pair: pair[0])]

    def _order(self, loc: Location) -> int:
        for length in range(len(loc), 0, -1):
            if loc[:length] in self.lines:
                return self.lines[loc[:length]]
        return 0


def _place(key: str, value: Any) -> str:
    """Return where a key of the outermost table stands."""
    if isinstance(value, Mapping):
        return f"it is a table of its own: [{key}]"
    if isinstance(value, list) and any(isinstance(item, Mapping) for item in value):
        return f"these are tables of their own: [[{key}]]"
    return "it stands at the top of the file, before the first line in brackets"


def shown(value: Any) -> str:
    """Return a value as it would stand in a case file, shortened; nothing for a whole table."""
    if value is _ABSENT or value is None or isinstance(value, Mapping):
        return ""
    try:
        text = literal(value)
    except TypeError:
        text = repr(value)
    return text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 1] + "…"


_KINDS = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "text in quotes",
    "bool_type": "true or false",
    "tuple_type": "a list in brackets",
    "finite_number": "a finite number",
    "missing": "this key is required",
    "model_type": "a table",
    "model_attributes_type": "a table",
    "dict_type": "a table",
}


def _excluded(pattern: str) -> str:
    """Return in words which characters a pattern leaves out; nothing where it is another kind of pattern."""
    found = re.fullmatch(r"\^\[\^(.*)\]\+\$", pattern)
    names = {r"\s": "blanks", ".": "dots", "/": "slashes", r"\\": "backslashes"}
    parts = re.findall(r"\\.|.", found[1]) if found else []
    return ", ".join(names.get(part, part) for part in parts)


def _message(item: Any) -> str:
    """Return what is allowed, from one of pydantic's errors."""
    context = item.get("ctx", {})
    kind = item["type"]
    if kind == "missing":
        return _KINDS[kind]
    if kind == "tuple_type" and isinstance(item["input"], Mapping) and len(item["loc"]) == 1:
        return f"write [[{item['loc'][0]}]]: there may be several, so its table stands in double brackets"
    if kind in _KINDS:
        return f"must be {_KINDS[kind]}"
    if kind == "literal_error":
        given = item["input"]
        choices = re.findall(r"'([^']*)'", context.get("expected", ""))
        near = nearest_match(given, choices) if isinstance(given, str) else ""
        return f"must be {context['expected']}{near}"
    if kind == "string_pattern_mismatch" and (excluded := _excluded(context["pattern"])):
        return f"must be text without {excluded}"
    if kind == "too_short":
        return f"must have at least {context['min_length']} entries, has {context['actual_length']}"
    if kind == "too_long":
        return f"must have at most {context['max_length']} entries, has {context['actual_length']}"
    message: str = item["msg"].removeprefix("Value error, ")
    return message.replace("Input should be", "must be").replace("String should", "text should")


def point_text(x: NDArray[np.float64]) -> str:
    """Return coordinates, shape (d,), as they stand in messages."""
    return f"({', '.join(f'{c:.4g}' for c in x)})"
