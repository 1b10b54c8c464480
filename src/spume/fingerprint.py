"""What the code of a function depends on, as text: its instructions and everything that they name.

A compiled kernel may be used again by another process as long as nothing that went into it has changed. Its file does
not say that: a function here is often made for a weight, a view or a number of threads, which it holds in its closure.
"""

import dataclasses
import dis
import functools
import hashlib
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import CodeType, FunctionType, ModuleType, SimpleNamespace
from typing import Any

OWN, LANGUAGE = "spume", "quadrants"


class Unknown(Exception):
    """Something stands in a function of which nobody can say whether it is the same in another process."""


def fingerprint(function: Any) -> str:
    """Return a text that is the same in every process exactly where a function and what it names are the same.

    Code and closure are followed into every function that it names, and into the modules that are no part of Spume
    or of the kernel language, whose own files `package_digest` covers.

    Raises:
        Unknown: an object of a kind that is not known to be described by its parts.
    """
    return _Writer().of(function)


@functools.cache
def package_digest() -> str:
    """Return a digest of Spume's source files."""
    return digest_of(Path(__file__).parent)


def digest_of(folder: Path) -> str:
    """Return a digest of the names and contents of the Python files in a folder and those below."""
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(folder).as_posix()}\n{len(content)}\n".encode())
        digest.update(content)
    return digest.hexdigest()


def _belongs(module: str, package: str) -> bool:
    return module == package or module.startswith(package + ".")


class _Writer:
    """One text for an object and its parts; what was met before is named by its number."""

    def __init__(self) -> None:
        self._met: dict[int, tuple[int, Any]] = {}

    def of(self, thing: Any) -> str:
        if thing is None or isinstance(thing, bool | int | float | str | bytes):
            return f"{type(thing).__name__}:{thing!r}"
        if id(thing) in self._met:
            return f"#{self._met[id(thing)][0]}"
        self._met[id(thing)] = len(self._met), thing  # kept, so that no other object takes its place in memory
        return f"{type(thing).__module__}.{type(thing).__qualname__}({self._parts(thing)})"

    def _parts(self, thing: Any) -> str:
        if isinstance(thing, CodeType):
            return self._code(thing)
        if isinstance(thing, FunctionType):
            return self._function(thing)
        if isinstance(thing, ModuleType):
            return self._module(thing)
        if isinstance(thing, type):
            return self._class(thing)
        if isinstance(thing, tuple | list):
            return ",".join(self.of(part) for part in thing)
        if isinstance(thing, dict):
            return ",".join(f"{self.of(key)}={self.of(part)}" for key, part in thing.items())
        if isinstance(thing, SimpleNamespace) or (
            dataclasses.is_dataclass(thing) and _belongs(type(thing).__module__, OWN)
        ):
            return self.of(dict(sorted(vars(thing).items())))
        if _belongs(type(thing).__module__, LANGUAGE):
            return self._of_language(thing)
        raise Unknown(f"{type(thing).__module__}.{type(thing).__qualname__}")

    def _function(self, function: FunctionType) -> str:
        if _belongs(function.__module__ or "", LANGUAGE):
            return f"{function.__module__}.{function.__qualname__}"
        cells = [cell.cell_contents for cell in function.__closure__ or ()]
        parts = [function.__code__, *cells, function.__defaults__, function.__kwdefaults__, function.__annotations__]
        named = {
            name: function.__globals__[name]
            for name in sorted(_global_names(function.__code__))
            if name in function.__globals__
        }
        return self.of((*parts, named, self._constants(function.__code__, named.values())))

    def _constants(self, code: CodeType, used: Iterable[Any]) -> dict[str, Any]:
        """Return the numbers and texts of modules of ours that a function may read by their module's name."""
        modules = [thing for thing in used if isinstance(thing, ModuleType) and _belongs(thing.__name__, OWN)]
        return {
            f"{module.__name__}.{name}": vars(module)[name]
            for module in modules
            for name in sorted(_names(code))
            if isinstance(vars(module).get(name), bool | int | float | str)
        }

    def _code(self, code: CodeType) -> str:
        outline = (code.co_code, code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars, code.co_argcount)
        return self.of((*outline, code.co_kwonlyargcount, code.co_flags, code.co_consts))

    def _module(self, module: ModuleType) -> str:
        name = module.__name__
        if _belongs(name, OWN) or _belongs(name, LANGUAGE) or name in sys.stdlib_module_names:
            return name
        try:
            return name + hashlib.sha256(Path(str(module.__file__)).read_bytes()).hexdigest()
        except OSError as error:
            raise Unknown(name) from error

    def _class(self, kind: type) -> str:
        name = f"{kind.__module__}.{kind.__qualname__}"
        if dataclasses.is_dataclass(kind):  # one that was made for a number of chunks has no text of its own
            return name + self.of({field.name: field.type for field in dataclasses.fields(kind)})
        if not any(_belongs(kind.__module__, known) for known in (OWN, LANGUAGE, "builtins")):
            raise Unknown(name)
        return name

    def _of_language(self, thing: Any) -> str:
        function = getattr(thing, "fn", None) or getattr(thing, "__wrapped__", None)
        if isinstance(function, FunctionType):
            return self.of(function)
        if not hasattr(thing, "__dict__"):
            return str(thing)
        return self.of({key: part for key, part in sorted(vars(thing).items()) if not key.startswith("__")})


def _within(code: CodeType) -> Iterator[CodeType]:
    """Yield the code of a function and of those in it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _within(constant)


def _names(code: CodeType) -> set[str]:
    """Return the names of what a function reads from outside, and of attributes."""
    return {name for part in _within(code) for name in part.co_names}


def _global_names(code: CodeType) -> set[str]:
    """Return the names of what a function reads from outside."""
    steps = (step for part in _within(code) for step in dis.get_instructions(part))
    return {step.argval for step in steps if step.opname in ("LOAD_GLOBAL", "LOAD_NAME")}
