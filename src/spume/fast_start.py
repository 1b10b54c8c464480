"""Kernels that an earlier process compiled, taken without translating them again.

The kernel language keeps compiled kernels on disk, under a key that it can tell only once it has translated a kernel
from Python, which takes far longer than to load it. It has a shorter way for kernels that name nothing beside their
arguments. Ours name functions and numbers that they were made for, so what they are kept under is a digest of
`spume.fingerprint`.
"""

import hashlib
import logging
import sys
from collections.abc import Callable
from typing import Any

from spume.fingerprint import Unknown, fingerprint, package_digest

log = logging.getLogger("spume")


class _Nothing(set[Any]):
    """A set that stays empty: the language would look into the files of what is put in here."""

    def add(self, thing: Any) -> None:
        """Leave it out."""


def _open(annotation: Any) -> bool:
    """Return whether an argument of this annotation may be of several types."""
    kind = annotation if isinstance(annotation, type) else type(annotation)
    if kind.__name__.lower() == "template":
        return True
    return any(getattr(annotation, name, "none") is None for name in ("dtype", "ndim"))


def remember(made: Any, function: Callable[..., Any], language: Any, circumstances: Callable[[], str]) -> None:
    """Let a kernel be loaded where it was compiled before from the same code; where that cannot be known, do nothing.

    The annotations of its arguments must say all of their types: a kernel that takes a function as its argument, or
    arrays of any type, is another one for each.

    Args:
        made: what the decorator of the kernel language returned.
        function: what was decorated.
        language: the kernel language's module.
        circumstances: says what the compiler depends on beside the code.
    """
    try:
        kernel, caching = made._primal, language.lang._fast_caching.src_hasher
        language.lang._fast_caching.config_hasher  # noqa: B018  (for the circumstances)
        level = sys.modules[type(kernel).__module__].GraphDoWhileLevel
        kernel._try_load_fastcache, kernel._maybe_persist_l1_and_set_l2_key, kernel.visited_functions  # noqa: B018
    except AttributeError:  # another version of the language: it translates
        return

    def key() -> str | None:
        if any(_open(argument.annotation) for argument in kernel.arg_metas):
            return None
        try:
            text = "\n".join((package_digest(), circumstances(), fingerprint(function)))
        except Unknown as thing:
            log.debug("kernel %s is translated at every start: %s", function.__name__, thing)
            return None
        return hashlib.sha256(text.encode()).hexdigest()

    def load(arguments: tuple[Any, ...], place: Any) -> set[str] | None:
        kernel.visited_functions = _Nothing()
        kernel.fast_checksum = key()
        try:
            found = caching.load(kernel.fast_checksum) if kernel.fast_checksum else None
        except OSError as error:  # a cache of somebody else, say
            log.debug("kernel %s is translated: %s", function.__name__, error)
            found = kernel.fast_checksum = None
        if found is None:
            return None
        program = language.lang.impl.get_runtime().prog
        compiled = program.load_fast_cache(
            found.frontend_cache_key, function.__name__, program.config(), program.get_device_caps()
        )
        if not compiled:
            return None
        kernel.compiled_kernel_data_by_key[place] = compiled
        kernel.used_py_dataclass_parameters_by_key_enforcing[place] = found.used_py_dataclass_parameters
        if found.graph_do_while_levels:
            kernel.graph_do_while_levels = [
                level(cond_arg_name=name, parent_id=parent, cond_cpp_arg_id=argument)
                for name, parent, argument in found.graph_do_while_levels
            ]
            kernel.graph_do_while_arg = kernel.graph_do_while_levels[0].cond_arg_name
        used: set[str] = found.used_py_dataclass_parameters
        return used

    kernel._try_load_fastcache = load
    kernel._maybe_persist_l1_and_set_l2_key = lambda *_: None
