"""Tables of keys and docstrings as Markdown, from the JSON Schema of case files: what the generators share."""

import inspect
import re
import unicodedata
from collections.abc import Mapping
from typing import Any

from spume.citation import bibliography

PAGES = {
    family: f"schemes/{family}.md"
    for family in (
        "air", "collision", "divergence", "free_surface", "gradient", "laplacian", "number_density", "shifting",
        "source", "turbulence", "viscosity", "wall_function", "weight",
    )
}  # fmt: skip
"""Families with a page of their own, from the folder docs."""
HEAD = "| key | type | unit | default | allowed | meaning |\n|---|---|---|---|---|---|"
_UNIT = re.compile(r" ?\[((?:1|m|s|kg|Pa|N|J|Hz|rad|degrees|(?:SI )?unit of)(?:[\^/ ]?[\w ^/()]*)?)\]")
_LENGTHS = {2: "two numbers", 3: "three numbers"}

Node = Mapping[str, Any]


def rows(table: Node, up: str = "", skip: frozenset[str] = frozenset()) -> str:
    """Return a Markdown table of all keys of a table of the schema; `up` leads to the folder docs."""
    required = set(table.get("required", []))
    lines = [row(key, node, key in required, up) for key, node in table["properties"].items() if key not in skip]
    return "\n".join([HEAD, *lines]) if lines else ""


def row(key: str, node: Node, required: bool, up: str = "") -> str:
    """Return the row of a key: name, type, unit, default, allowed values, meaning."""
    if "const" in node:
        return f'| `{key}` | text | – | required | `"{node["const"]}"` | selects this model |'
    unit, meaning = meaning_of(node.get("description", ""))
    kind, allowed = kind_of(node, up)
    default = "required" if required else default_of(node)
    return "| " + " | ".join([f"`{key}`", kind, unit, default, allowed, meaning]) + " |"


def meaning_of(description: str) -> tuple[str, str]:
    """Return the unit in a description's first square brackets, and the description without it, for a cell."""
    text = re.sub(r"\s+", " ", description).strip()
    code = re.split(r"(``.*?``)", text)  # a unit in code is part of an example
    for index in range(0, len(code), 2):
        found = _UNIT.search(code[index])
        if found:
            code[index] = code[index][: found.start()] + code[index][found.end() :]
            return found[1], cell("".join(code))
    return "–", cell(text)


def cell(text: str) -> str:
    """Return text for a cell of a table."""
    return _escaped(text).replace("|", "\\|")


def kind_of(node: Node, up: str) -> tuple[str, str]:
    """Return type and allowed values of a key."""
    if "$ref" in node:
        name = node["$ref"].rsplit("/", 1)[1]
        if name.startswith("family-"):
            family = name.removeprefix("family-")
            return "name or table", f"[{family}]({link_to(family, up)})"
        return "table", f"[keys](#{name.lower()})"
    if "anyOf" in node:
        choices = [kind_of(choice, up) for choice in node["anyOf"] if choice.get("type") != "null"]
        kinds, allowed = list(dict.fromkeys(k for k, _ in choices)), list(dict.fromkeys(a for _, a in choices if a))
        return " or ".join(kinds), ", ".join(allowed)
    if "enum" in node or "const" in node:
        values = node.get("enum", [node.get("const")])
        return "text" if isinstance(values[0], str) else "whole number", ", ".join(f"`{_toml(v)}`" for v in values)
    if node.get("type") == "array":
        return _list_of(node, up)
    if node.get("type") in ("number", "integer"):
        return "number" if node["type"] == "number" else "whole number", _range(node)
    if node.get("type") == "boolean":
        return "yes or no", "`true`, `false`"
    if node.get("type") == "string":
        lengths = [f"at most {node['maxLength']} characters"] if "maxLength" in node else []
        if "pattern" in node:
            lengths.append("no blanks, slashes or dots" if "\\." in node["pattern"] else "no blanks or slashes")
        return "file" if node.get("format") == "path" else "text", ", ".join(lengths)
    raise ValueError(f"no words for {node}")


def link_to(family: str, up: str) -> str:
    """Return where a family is described."""
    return up + PAGES.get(family, f"reference/case-file.md#{family.replace('_', '-')}")


def default_of(node: Node) -> str:
    """Return the default as a case file writes it."""
    value = node.get("default")
    if value is None:
        return "–"
    if isinstance(value, Mapping):
        name = value.get("name", value.get("kind"))
        return f'`"{name}"`' if name else "–"
    if isinstance(value, list) and value and isinstance(value[0], Mapping):
        return ", ".join(f'`"{item.get("name", item.get("kind"))}"`' for item in value)
    return f"`{_toml(value)}`"


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, list):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    return f"{value:g}" if isinstance(value, float) and abs(value) < 1e-3 and value else str(value)


def _list_of(node: Node, up: str) -> tuple[str, str]:
    if "prefixItems" in node:
        return f"list of {_LENGTHS[len(node['prefixItems'])]}", ""
    items = node.get("items", {})
    if "$ref" in items:
        kind, allowed = kind_of(items, up)
        return "list of tables", allowed
    kind, allowed = kind_of(items, up)
    plural = {"number": "list of numbers", "text": "list of texts", "whole number": "list of whole numbers"}
    return plural.get(kind, f"list of: {kind}"), allowed


def _range(node: Node) -> str:
    low, above = node.get("minimum"), node.get("exclusiveMinimum")
    high, below = node.get("maximum"), node.get("exclusiveMaximum")
    parts = []
    if low is not None and high is not None:
        return f"{low:g} … {high:g}"
    if above is not None or low is not None:
        parts.append(f"> {above:g}" if above is not None else f"≥ {low:g}")
    if below is not None or high is not None:
        parts.append(f"< {below:g}" if below is not None else f"≤ {high:g}")
    return ", ".join(parts)


# --------------------------------------------------------------------------------------- docstrings


def prose(docstring: str) -> str:
    """Return a docstring as Markdown: literals keep one backtick, words in angle brackets are no HTML.

    Indented paragraphs (formulas) stay as they are; sections such as ``Args:`` are left out.
    """
    text = inspect.cleandoc(docstring)
    text = re.split(r"\n(?:Args|Raises|Attributes|Returns):", text)[0].strip()
    paragraphs = re.split(r"\n\s*\n", text)
    return "\n\n".join(p if p.startswith("    ") else _escaped(p) for p in paragraphs)


def _escaped(text: str) -> str:
    """Return text whose words are no Markdown and no HTML, outside literals."""
    parts = re.split(r"(``?[^`]+``?)", text)
    for index, part in enumerate(parts):
        if index % 2:
            parts[index] = part.replace("``", "`")
        else:
            plain = part.replace("&", "&amp;").replace("<", "&lt;").replace("_", "\\_")
            parts[index] = re.sub(r"(?m)(?<!^)\*|^\*(?! )", r"\\*", plain)
    return "".join(parts)


# ------------------------------------------------------------------------------------------------ sources


def publications() -> dict[str, str]:
    """Return each entry of references.bib as one line of text, by its key."""
    found = {}
    for key, body in bibliography().items():
        fields = dict(re.findall(r"(\w+)\s*=\s*\{(.*?)\}\s*,?\s*$", body, re.MULTILINE | re.DOTALL))
        place = fields.get("journal") or fields.get("booktitle") or fields.get("publisher") or fields.get("school", "")
        where = " ".join(filter(None, [place, fields.get("volume", "")]))
        pages = fields.get("pages", "").replace("--", "–")
        line = (
            f"{fields.get('author', '').replace(' and ', '; ')} ({fields.get('year', '')}). {fields.get('title', '')}."
        )
        line += f" {where}{', ' + pages if pages else ''}."
        if "doi" in fields:
            line += f" [doi:{fields['doi']}](https://doi.org/{fields['doi']})"
        line = re.sub(r"\\([\"'`^~])\{?(\w)\}?", lambda accent: accent[2] + _ACCENTS[accent[1]], line)
        line = line.replace("\\&", "&").replace("--", "–")
        found[key] = unicodedata.normalize("NFC", re.sub(r"\s+", " ", re.sub(r"[{}]", "", line)))
    return found


_ACCENTS = {'"': "\u0308", "'": "\u0301", "`": "\u0300", "^": "\u0302", "~": "\u0303"}
