"""TOML: where in a file each key stands, values given on the command line, and writing."""

from __future__ import annotations

import datetime
import math
import re
import tomllib
from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from spume.named import Location

_BARE = re.compile(r"[A-Za-z0-9_-]+")


def key_lines(text: str) -> dict[Location, int]:
    """Return the line on which each key and each element of an array of a TOML document begins.

    `text` must be valid TOML; values are skipped, not read. Tables that only appear as part of a
    longer key stand on that key's line.
    """
    return _Scanner(text).document()


class _Scanner:
    """Walks once through a valid TOML document and notes the line of everything that has a name."""

    def __init__(self, text: str) -> None:
        self.text = text.replace("\r\n", "\n")
        self.at = 0
        self.ends = [m.start() for m in re.finditer("\n", self.text)]
        self.found: dict[Location, int] = {}
        self.elements: dict[Location, int] = {}  # how many elements each array of tables has so far

    def document(self) -> dict[Location, int]:
        prefix: Location = ()
        while self.skip():
            if self.take("[["):
                path = self.within(self.key())
                index = self.elements.get(path, 0)
                self.elements[path] = index + 1
                prefix = (*path, index)
                self.note(prefix)
                self.take("]]")
            elif self.take("["):
                prefix = self.within(self.key())
                self.note(prefix)
                self.take("]")
            else:
                self.pair(prefix)
        return self.found

    def within(self, key: Sequence[str]) -> Location:
        """Return the path of a header, which leads through the last element of arrays of tables."""
        path: Location = ()
        for number, part in enumerate(key):
            path = (*path, part)
            if path in self.elements and number < len(key) - 1:
                path = (*path, self.elements[path] - 1)
        return path

    def note(self, path: Location) -> None:
        line = bisect_right(self.ends, self.at - 1) + 1
        for length in range(1, len(path) + 1):
            self.found.setdefault(path[:length], line)

    def skip(self) -> bool:
        """Pass over blanks and comments; return whether anything is left."""
        while self.at < len(self.text):
            if self.text[self.at] in " \t\n\r,":
                self.at += 1
            elif self.text[self.at] == "#":
                self.at = next((end for end in self.ends if end >= self.at), len(self.text))
            else:
                return True
        return False

    def take(self, token: str) -> bool:
        if self.text.startswith(token, self.at):
            self.at += len(token)
            return True
        return False

    def key(self) -> list[str]:
        parts = []
        while True:
            self.skip()
            if self.text[self.at] in "\"'":
                parts.append(self.string())
            else:
                match = _BARE.match(self.text, self.at)
                if match is None:  # not TOML after all
                    raise ValueError("no key")
                self.at = match.end()
                parts.append(match.group())
            self.skip()
            if not self.take("."):
                return parts

    def pair(self, prefix: Location) -> None:
        self.skip()
        start = self.at
        path = (*prefix, *self.key())
        end, self.at = self.at, start
        self.note(path)
        self.at = end
        self.take("=")
        self.value(path)

    def value(self, path: Location) -> None:
        self.skip()
        self.note(path)
        if self.take("["):
            index = 0
            while self.skip() and not self.take("]"):
                self.value((*path, index))
                index += 1
        elif self.take("{"):
            while self.skip() and not self.take("}"):
                self.pair(path)
        elif self.text[self.at] in "\"'":
            self.string()
        else:
            while self.at < len(self.text) and self.text[self.at] not in ",]}\n#":
                self.at += 1

    def string(self) -> str:
        quote = self.text[self.at]
        fence = quote * 3 if self.text.startswith(quote * 3, self.at) else quote
        self.at += len(fence)
        start = self.at
        while not self.text.startswith(fence, self.at):
            self.at += 2 if quote == '"' and self.text[self.at] == "\\" else 1
        inner = self.text[start : self.at]
        self.at += len(fence)
        while len(fence) == 3 and self.text.startswith(quote, self.at):  # up to two quotes may precede it
            self.at += 1
        return inner


def read_value(text: str) -> Any:
    """Return the value that a command line gives: TOML where it is TOML, else the text itself."""
    try:
        document = tomllib.loads(f"value = {text}")
    except (tomllib.TOMLDecodeError, RecursionError):
        return text
    return document["value"] if set(document) == {"value"} else text


def dumps(document: Mapping[str, Any]) -> str:
    """Return a document as TOML: scalars first, then ``[tables]`` and ``[[arrays of tables]]``.

    Tables deeper than the first level are written inline; keys whose value is None are left out.
    """
    lines: list[str] = []
    tables: list[str] = []
    for key, value in document.items():
        if isinstance(value, Mapping):
            tables += ["", f"[{_key(key)}]", *_pairs(value)]
        elif _is_table_array(value):
            for table in value:
                tables += ["", f"[[{_key(key)}]]", *_pairs(table)]
        elif value is not None:
            lines.append(f"{_key(key)} = {literal(value)}")
    return "\n".join(lines + tables) + "\n"


def _pairs(table: Mapping[str, Any]) -> list[str]:
    return [f"{_key(key)} = {literal(value)}" for key, value in table.items() if value is not None]


def _is_table_array(value: Any) -> bool:
    return isinstance(value, list | tuple) and bool(value) and all(isinstance(v, Mapping) for v in value)


def _key(key: str) -> str:
    return key if _BARE.fullmatch(key) else literal(key)


def literal(value: Any) -> str:
    """Return a value as TOML, on one line.

    Raises:
        TypeError: TOML has no such type.
    """
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        if not math.isfinite(value):
            return "nan" if math.isnan(value) else f"{'-' if value < 0 else ''}inf"
        text = repr(float(value))
        return text if any(c in text for c in ".en") else text + ".0"
    if isinstance(value, str | Path):
        return _string(value.as_posix() if isinstance(value, Path) else value)
    if isinstance(value, datetime.date | datetime.time):
        return value.isoformat()
    if isinstance(value, Mapping):
        inner = ", ".join(f"{_key(str(k))} = {literal(v)}" for k, v in value.items() if v is not None)
        return f"{{{inner}}}" if not inner else f"{{ {inner} }}"
    if isinstance(value, list | tuple | set | frozenset):
        return f"[{', '.join(literal(item) for item in value)}]"
    raise TypeError(f"{value!r} cannot be written as TOML")


def _string(text: str) -> str:
    escapes = {"\\": "\\\\", '"': '\\"', "\n": "\\n", "\t": "\\t", "\r": "\\r"}
    return '"' + "".join(escapes.get(c, c if c.isprintable() else f"\\U{ord(c):08X}") for c in text) + '"'


def flattened(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted key and value of everything in a table."""
    if isinstance(value, Mapping):
        for name, item in value.items():
            yield from flattened(item, f"{key}.{name}" if key else str(name))
    elif isinstance(value, list) and any(isinstance(item, Mapping) for item in value):
        for index, item in enumerate(value):
            yield from flattened(item, f"{key}.{index}")
    else:
        yield key, value
