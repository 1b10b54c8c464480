"""Schemes: frozen parameter objects that register themselves under a family and a name."""

from __future__ import annotations

import ast
import difflib
import functools
import importlib
import importlib.metadata
import importlib.resources
import inspect
import itertools
import math
import pkgutil
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    GetCoreSchemaHandler,
    GetJsonSchemaHandler,
    PlainSerializer,
    PlainValidator,
    SerializationInfo,
    ValidationError,
    ValidationInfo,
    WithJsonSchema,
    model_validator,
)
from pydantic.json_schema import GenerateJsonSchema
from pydantic_core import CoreSchema, InitErrorDetails, PydanticCustomError, core_schema

from spume.planned import planned

_registry: dict[str, dict[str, type[Scheme]]] = {}
_family: dict[str, type[Scheme]] = {}


def nearest_match(word: str, known: Iterable[str]) -> str:
    """Return ``"; did you mean 'x'?"`` for the known word nearest to `word`, or an empty text."""
    candidates = list(known)
    found = difflib.get_close_matches(word, candidates, n=1, cutoff=0.5)
    if not found:  # difflib looks for letters in order only: "Corrected" or "pois" deserve an answer too
        start = word.lower()
        found = [k for k in candidates if k.lower() == start or (len(word) > 2 and k.startswith(start))][:1]
    return f"; did you mean {found[0]!r}?" if found else ""


class Parameters(BaseModel):
    """A frozen set of parameters that refuses unknown keys, text for numbers, NaN and infinity.

    Every list becomes a tuple, so that a TOML array may stand wherever a parameter is a tuple and
    nothing inside a frozen object can change. Whole numbers are taken where real ones are expected.
    """

    model_config = ConfigDict(
        frozen=True,
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        validate_default=False,
        arbitrary_types_allowed=True,
        defer_build=True,
    )

    def __init__(self, /, **data: Any) -> None:
        """Take the parameters as keyword arguments.

        Raises:
            CaseError: every mistake that was found, with the class in place of a file.
        """
        try:
            super().__init__(**data)
        except ValidationError as error:
            from spume.problems import CaseError, Origin

            raise CaseError(Origin(type(self).__name__, data).problems(error)) from None

    # Says that validating a table need not go through the constructor: nested mistakes keep their places.
    __init__.__pydantic_base_init__ = True  # type: ignore[attr-defined]

    @model_validator(mode="before")
    @classmethod
    def _read_table(cls, value: Any, info: ValidationInfo) -> Any:
        """Turn lists into tuples and name unknown keys with the nearest known one."""
        if not isinstance(value, Mapping):
            return value
        fields, keys = cls.model_fields, cls.table_keys()
        known = {key: cls._completed(key, _tuples(item)) for key, item in value.items() if key in fields}
        errors = [
            InitErrorDetails(type=_BEYOND, loc=loc, input=number)
            for key, item in known.items()
            for loc, number in _beyond(item, (key,))
        ]
        if len(known) == len(value) and not errors:
            return known
        known = {key: item for key, item in known.items() if not any(error["loc"][0] == key for error in errors)}
        meant = {str(error["loc"][0]) for error in errors}
        for key in value:
            if key not in fields:
                near = cls._table_of(str(key)) or nearest_match(str(key), keys)
                meant.update(k for k in keys if near.endswith(f"{k!r}?"))
                message = f"no such key; allowed: {', '.join(keys) or '(none)'}{near}"
                error = PydanticCustomError("unknown_key", "{message}", {"message": message})
                errors.append(InitErrorDetails(type=error, loc=(key,), input=value[key]))
        try:  # one mistake must not hide what else is wrong
            cls.model_validate(known, context=info.context)
        except ValidationError as others:
            for item in others.errors(include_url=False):
                if item["type"] == "missing" and item["loc"][0] in meant:
                    continue
                context = {**item.get("ctx", {}), "message": item["msg"]}
                error = PydanticCustomError(item["type"], "{message}", context)
                errors.append(InitErrorDetails(type=error, loc=item["loc"], input=item["input"]))
        raise ValidationError.from_exception_data(cls.__name__, errors)

    @classmethod
    def table_keys(cls) -> tuple[str, ...]:
        """Return the keys of a table of these parameters."""
        return tuple(cls.model_fields)

    @classmethod
    def _table_of(cls, key: str) -> str:
        """Return ``"; did you mean 'table.key'?"`` where a table inside has a key of that name, or an empty text."""
        for name, field in cls.model_fields.items():
            inside = field.annotation
            if inspect.isclass(inside) and issubclass(inside, Parameters) and key in inside.model_fields:
                return f"; did you mean {f'{name}.{key}'!r}?"
        return ""

    @classmethod
    def _completed(cls, key: str, item: Any) -> Any:
        """Let a table that does not say which scheme it is about be about the default one, as it is there."""
        return _about(cls.model_fields[key].default, item)


def _about(default: Any, item: Any) -> Any:
    """Return a table about a scheme, with what the default sets where the table names no scheme of its own."""
    if not (isinstance(item, Mapping) and isinstance(default, Scheme)) or default.selector in item:
        return item
    own = {name: getattr(default, name) for name in sorted(default.model_fields_set)}
    return {
        default.selector: default.key,
        **{name: value for name, value in own.items() if name not in item},
        **{name: _about(own.get(name), value) for name, value in item.items()},
    }


SMALLEST, LARGEST = 1e-100, 1e18
"""Size of a parameter that is not zero: squares and cubes of what is beyond are no longer numbers."""
_BEYOND = PydanticCustomError(
    "beyond", "must be 0 or of a size from {low} to {high}", {"low": f"{SMALLEST:g}", "high": f"{LARGEST:g}"}
)


def _beyond(item: Any, loc: Location) -> Iterator[tuple[Location, Any]]:
    """Yield place and value of the finite numbers of a list of lists that are too large or too small."""
    if isinstance(item, tuple):
        for index, part in enumerate(item):
            yield from _beyond(part, (*loc, index))
    elif isinstance(item, int | float):  # a coordinate may be as near to zero as it likes
        least = SMALLEST if len(loc) == 1 else 0.0
        if LARGEST < abs(item) < math.inf or 0.0 < abs(item) < least:
            yield loc, item


def _tuples(value: Any) -> Any:
    if hasattr(value, "tolist") and getattr(value, "ndim", None):
        value = value.tolist()
    return tuple(_tuples(item) for item in value) if isinstance(value, list) else value


class Scheme(Parameters):
    """A model that a case file selects by name; inheriting from a family with ``name=`` registers it.

    A *family* is a direct subclass that gives ``family=`` (``Gradient``, ``Weight`` …); a scheme is
    a subclass of a family that gives ``name=``. Wherever a family is the type of a parameter, a case
    file may write the bare name (``gradient = "corrected"``) or a table with the scheme's own
    parameters (``gradient = {name = "corrected", largest_condition = 100.0}``).
    """

    family: ClassVar[str] = ""
    """Name of the family, the word used in case files and in ``spume schemes``."""
    key: ClassVar[str] = ""
    """Name of the scheme within its family, given as ``name=`` when it is defined."""
    selector: ClassVar[str] = "name"
    """Key that holds the scheme's name in a table: ``name``, or ``kind`` where ``name`` is a label."""
    ids: ClassVar[tuple[str, ...]] = ()
    """Rows of the review's table of systems (``A1`` … ``L11``) that this scheme implements."""
    reference: ClassVar[str | tuple[str, ...]] = ()
    """Key of its publication in ``src/spume/references.bib``, or of several; none for a model of this project."""
    order: ClassVar[int | None] = None
    """Degree of the polynomials reproduced on any arrangement of particles; None where it has no meaning."""
    conserves: ClassVar[frozenset[str]] = frozenset()
    """Quantities conserved to round-off: ``momentum``, ``angular momentum``, ``volume``."""
    unused: ClassVar[Mapping[str, str]] = {}
    """Parameters of the family with which this model does not compute, each with the reason: no keys of its table."""

    @classmethod
    def table_keys(cls) -> tuple[str, ...]:
        """Return the keys of a table of the scheme, without the one that selects it."""
        return tuple(key for key in cls.model_fields if key not in cls.unused)

    @model_validator(mode="after")
    def _without_unused(self) -> Self:
        """Refuse what would have no effect; the default, as completed cases once had it, does no harm."""
        errors = []
        for key, why in type(self).unused.items():
            if (given := getattr(self, key)) != type(self).model_fields[key].default:
                message = f"has no effect on {self.family} {self.key!r}: {why}; leave it out"
                error = PydanticCustomError("unused", "{message}", {"message": message})
                shown = given.key if isinstance(given, Scheme) else given
                errors.append(InitErrorDetails(type=error, loc=(key,), input=shown))
        if errors:
            raise ValidationError.from_exception_data(type(self).__name__, errors)
        return self

    @classmethod
    def publications(cls) -> tuple[str, ...]:
        """Return the keys of the publications that it comes from, whatever its parameters."""
        if isinstance(cls.reference, tuple):
            return cls.reference
        return (cls.reference,) if cls.reference else ()

    def cited(self) -> tuple[str, ...]:
        """Return the keys of the publications that it rests on with its parameters."""
        return self.publications()

    def needed(self) -> tuple[Any, ...]:
        """Return the fields of the particle table that the scheme needs with its parameters."""
        return tuple(getattr(type(self), "needs", ()))

    def __init_subclass__(cls, *, name: str = "", family: str = "", selector: str = "", **kwargs: Any) -> None:
        super().__init_subclass__(**kwargs)
        if family:
            cls.family = family
            cls.selector = selector or "name"
            _registry.setdefault(family, {})
            _family[family] = cls
        if name:
            if not cls.family:
                raise TypeError(f"{cls.__name__}: a scheme needs a family to be named in")
            known = _registry[cls.family].get(name)
            if known is not None and known.__qualname__ != cls.__qualname__:
                raise TypeError(f"{cls.family} {name!r} is already {known.__qualname__}")
            cls.key = name
            _registry[cls.family][name] = cls

    @classmethod
    def __pydantic_init_subclass__(cls, **kwargs: Any) -> None:
        names = {"family", "key", "selector", "ids", "reference", "order", "conserves", "unused"}
        claims = names & set(cls.model_fields)
        if claims:  # an annotation without ClassVar would silently turn a claim into a key of the case file
            raise TypeError(f"{cls.__name__}: write {', '.join(sorted(claims))} as a ClassVar")
        if cls.key and cls.selector in cls.model_fields:
            raise TypeError(f"{cls.__name__}: {cls.selector!r} selects the scheme and cannot be a parameter")
        if unknown := set(cls.unused) - set(cls.model_fields):
            raise TypeError(f"{cls.__name__}: it has no {', '.join(sorted(unknown))} to leave unused")

    @classmethod
    def shorthand(cls, value: Any) -> Any:
        """Return the table that a short spelling stands for; a family may accept more than its names.

        `value` is what the case file holds. What is not understood is returned unchanged.
        """
        return {cls.selector: value} if isinstance(value, str) else value

    @classmethod
    def shorthand_schema(cls) -> list[dict[str, Any]]:
        """Return the JSON Schemas of the short spellings that `shorthand` accepts beside the names."""
        return []

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        if cls.key or not cls.family:
            return handler(source)
        return core_schema.with_info_plain_validator_function(
            cls._from_name_or_table,
            serialization=core_schema.plain_serializer_function_ser_schema(
                lambda scheme, info: to_table(scheme, info.context), info_arg=True
            ),
        )

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        if cls.key or not cls.family:
            return handler(schema)
        return {"x-family": cls.family}  # `json_schema` puts the family's choices in its place

    @classmethod
    def _from_name_or_table(cls, value: Any, info: ValidationInfo) -> Scheme:
        if isinstance(value, cls) and value.key:
            return value
        table = cls.shorthand(value)
        if not isinstance(table, Mapping) or not isinstance(table.get(cls.selector), str):
            form = PydanticCustomError(
                "scheme_form",
                "a {family} by name, or a table with its {selector} and parameters; names: {choices}",
                {"family": cls.family, "selector": cls.selector, "choices": _choices(cls.family)},
            )
            given = cls.selector if isinstance(table, Mapping) and cls.selector in table else None
            if given is None and isinstance(table, Mapping):
                given = next((key for key in table if nearest_match(str(key), [cls.selector])), None)
            if given is None:
                raise form
            if given != cls.selector:
                words = {"message": f"no such key{nearest_match(str(given), [cls.selector])}"}
                form = PydanticCustomError("unknown_key", "{message}", words)
            details = InitErrorDetails(type=form, loc=(given,), input=table[given])
            raise ValidationError.from_exception_data(cls.__name__, [details])
        try:
            scheme = find(cls.family, table[cls.selector])
        except PydanticCustomError as error:
            loc = () if isinstance(value, str) else (cls.selector,)
            details = InitErrorDetails(type=error, loc=loc, input=table[cls.selector])
            raise ValidationError.from_exception_data(cls.__name__, [details]) from None
        parameters = {key: item for key, item in table.items() if key != cls.selector}
        return scheme.model_validate(parameters, context=info.context)


def _choices(family: str) -> str:
    return ", ".join(sorted(_registry.get(family, {}))) or "(none)"


def find(family: str, name: str) -> type[Scheme]:
    """Return the scheme class of that name.

    Raises:
        PydanticCustomError: no such scheme; the message lists the names and the nearest one.
    """
    if name not in _registry.get(family, {}):
        load_all()  # whoever writes a case in Python has imported only what the defaults are
    known = _registry.get(family, {})
    if name in known:
        return known[name]
    soon = planned(family, name)
    raise PydanticCustomError(
        "scheme_name",
        "{soon}one of {choices}{nearest}",
        {"soon": soon, "choices": _choices(family), "nearest": "" if soon else nearest_match(name, known)},
    )


def schemes(family: str | None = None) -> Iterator[type[Scheme]]:
    """Yield every registered scheme class, of one family or of all, sorted by family and name."""
    for key in sorted(_registry) if family is None else [family]:
        yield from (known for _, known in sorted(_registry.get(key, {}).items()))


_FOLDERS = ("schemes", "motion", "steps", "pressure", "wall_models", "bodies", "geometry", "initial", "outputs")


def load_all() -> None:
    """Import every module that may define schemes, and the packages that announce some.

    Other packages do so through the entry point ``spume.schemes``.
    """
    importlib.import_module("spume.gravity")
    for folder in _FOLDERS:
        package = importlib.import_module(f"spume.{folder}")
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            importlib.import_module(module.name)
    for entry in importlib.metadata.entry_points(group="spume.schemes"):
        entry.load()


def to_table(scheme: Scheme, context: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return the table that a case file would hold for this scheme: its name and all its parameters.

    Args:
        scheme: the scheme.
        context: ``folder``, below which files are named relative to it.
    """
    return {scheme.selector: scheme.key, **scheme.model_dump(context=context, exclude=set(scheme.unused))}


class OneOrMore:
    """Marks a tuple of which a case file may write the only element without brackets.

    ``initial: Annotated[tuple[Initial, ...], OneOrMore()]``
    """

    def __get_pydantic_core_schema__(self, source: Any, handler: GetCoreSchemaHandler) -> CoreSchema:
        def wrapped(value: Any) -> Any:
            return value if isinstance(value, list | tuple) else (value,)

        return core_schema.no_info_before_validator_function(wrapped, handler(source))

    def __get_pydantic_json_schema__(self, schema: CoreSchema, handler: GetJsonSchemaHandler) -> dict[str, Any]:
        array = handler(schema)
        return {"anyOf": [array["items"], array]}


# ---------------------------------------------------------------------------------------------- files

CASES = Path(str(importlib.resources.files("spume") / "cases"))
"""Folder of the built-in cases, whose data any case may name: ``dam-break/pressure-2.csv``."""


def _read_path(value: Any, info: ValidationInfo) -> Path:
    if not isinstance(value, str | Path) or not str(value) or "\0" in str(value):
        raise PydanticCustomError("file_form", "must be the path of a file, as text")
    folder = Path((info.context or {}).get("folder") or ".")
    for path in (folder / value, CASES / value):
        try:
            if path.is_file():
                return path.absolute()
        except OSError as error:  # a name that no file can have
            why = {"why": str(error.strerror)}
            raise PydanticCustomError("file_form", "must be the path of a file: {why}", why) from None
    raise PydanticCustomError(
        "file_missing",
        "no such file in {folder}, the folder of the case file, nor among the built-in cases",
        {"folder": str(folder.absolute())},
    )


def _write_path(path: Path, info: SerializationInfo) -> str:
    for folder in (CASES, (info.context or {}).get("folder")):
        if folder is not None and path.is_relative_to(folder):
            return path.relative_to(folder).as_posix()
    return path.as_posix()


File = Annotated[
    Path,
    PlainValidator(_read_path),
    PlainSerializer(_write_path, return_type=str),
    WithJsonSchema({"type": "string", "format": "path"}),
]
"""Type of a parameter that names an existing file, relative to the folder of the case file or, where
there is none, to the folder of the built-in cases. It holds the absolute path."""


# --------------------------------------------------------------------------------------- JSON Schema


def attribute_docs(cls: type) -> dict[str, str]:
    """Return what the text under each annotated attribute of a parameter class and of its bases says."""
    bases = [base for base in reversed(cls.__mro__) if issubclass(base, Parameters)]
    return {key: text for base in bases for key, text in _own_docs(base).items()}


@functools.cache
def _own_docs(cls: type) -> dict[str, str]:
    """Read from the source when asked for: doing it for every class at import takes a quarter of a second."""
    try:
        tree = ast.parse(textwrap.dedent(inspect.getsource(cls)))
    except (OSError, TypeError, SyntaxError):  # typed at a prompt
        return {}
    found: dict[str, str] = {}
    body = tree.body[0].body if isinstance(tree.body[0], ast.ClassDef) else []
    for attribute, text in itertools.pairwise(body):
        named = isinstance(attribute, ast.AnnAssign) and isinstance(attribute.target, ast.Name)
        words = text.value if isinstance(text, ast.Expr) else None
        if named and isinstance(words, ast.Constant) and isinstance(words.value, str):
            found[attribute.target.id] = inspect.cleandoc(words.value)  # type: ignore[attr-defined]
    return found


class _Defaults(GenerateJsonSchema):
    """Writes schemes among the defaults as a case file does, with their names, and describes every key."""

    def model_schema(self, schema: Any) -> dict[str, Any]:
        made = super().model_schema(schema)
        docs = attribute_docs(schema["cls"])
        for key in getattr(schema["cls"], "unused", ()):
            del made["properties"][key]
        for key, entry in made.get("properties", {}).items():
            if key in docs:
                entry["description"] = docs[key]
        return made

    def encode_default(self, dft: Any) -> Any:
        if isinstance(dft, Scheme):
            return super().encode_default(to_table(dft))
        if isinstance(dft, tuple):
            return [self.encode_default(item) for item in dft]
        return super().encode_default(dft)


def json_schema(model: type[BaseModel]) -> dict[str, Any]:
    """Return the JSON Schema of `model` with every registered scheme of the families that it uses."""
    definitions: dict[str, Any] = {}

    def adopt(schema: dict[str, Any]) -> dict[str, Any]:
        for name, definition in schema.pop("$defs", {}).items():
            if name not in definitions:
                definitions[name] = None  # reserve: a definition may refer to itself
                definitions[name] = replace(definition)
        return replace(schema)

    def replace(node: Any) -> Any:
        if isinstance(node, list):
            return [replace(item) for item in node]
        if not isinstance(node, dict):
            return node
        if "x-family" not in node:
            return {key: replace(item) for key, item in node.items()}
        family = node["x-family"]
        name = f"family-{family}"
        if name not in definitions:
            definitions[name] = None
            choices: list[Any] = [{"enum": [scheme.key for scheme in schemes(family)]}]
            for scheme in schemes(family):
                table = adopt(scheme.model_json_schema(schema_generator=_Defaults))
                selector = {scheme.selector: {"const": scheme.key}}
                table["properties"] = selector | table.get("properties", {})
                table["required"] = [scheme.selector, *table.get("required", [])]
                choices.append(table)
            definitions[name] = {"anyOf": choices + _family[family].shorthand_schema()}
        return {"$ref": f"#/$defs/{name}"} | {k: replace(v) for k, v in node.items() if k != "x-family"}

    schema = adopt(model.model_json_schema(schema_generator=_Defaults))
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "$defs": definitions}


Location = tuple[int | str, ...]
"""Keys and indices that lead to a value of a case: ``("fluid", 0, "density")``."""


def walk(value: Any, visit: Callable[[Parameters, Location], None], loc: Location = ()) -> None:
    """Call ``visit(parameters, loc)`` for `value` and every `Parameters` inside it, outermost first."""
    if isinstance(value, Parameters):
        visit(value, loc)
        for name in type(value).table_keys():
            walk(getattr(value, name), visit, (*loc, name))
    elif isinstance(value, tuple):
        for index, item in enumerate(value):
            walk(item, visit, (*loc, index))
