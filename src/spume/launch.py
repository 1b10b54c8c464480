"""Launching kernels without the questions that the kernel language asks at every call.

A call of a kernel costs it about 40 µs on one core of 2026 whatever the kernel does, of which the launch itself takes
6: it looks at the type of each argument, hashes the arguments and looks them up. A step makes some 80 calls, most of
them the same as in the step before but for numbers, so what the first call found out is kept.
"""

from collections.abc import Callable, Collection, Sequence
from dataclasses import fields, is_dataclass
from typing import Any, NamedTuple


def launcher(kernel: Any, language: Any) -> Callable[..., Any]:
    """Return a function that launches a kernel of arrays, structs and numbers as its first call did, only sooner.

    Later calls must have arrays of the same types as the first, as the annotations of their arguments ask for. Kernels
    with other arguments, or made by another version of the language, are called as they are.

    Args:
        kernel: what the decorator of the kernel language returned.
        language: the kernel language's module.
    """
    launch: Callable[..., Any] | None = None

    def call(*arguments: Any) -> Any:
        nonlocal launch
        if launch is not None:
            return launch(*arguments)
        value = kernel(*arguments)
        launch = _planned(kernel, language) or kernel
        return value

    return call


def _planned(kernel: Any, language: Any) -> Callable[..., Any] | None:
    """Return what launches a kernel that has been called before, or nothing where its arguments do not allow it."""
    try:
        types = language.types
        array_type, real_types = types.ndarray_type.NdarrayType, types.primitive_types.real_type_ids
        integer_types = types.primitive_types.integer_type_ids
        made = kernel._primal
        key = made._last_launch_key
        slots = _slots(made.arg_metas, made.used_py_dataclass_parameters_by_key_enforcing.get(key) or ())
        prepared, compiled = made.materialized_kernels[key], made.compiled_kernel_data_by_key[key]
        unusual = made.return_type or made.has_print or made.use_graph or made.use_checkpoints
        program = language.lang.impl.get_runtime().prog
    except (AttributeError, KeyError):
        return None
    kinds = [slot.kind for slot in slots]
    arrays = tuple(k for k, kind in enumerate(kinds) if isinstance(kind, array_type))
    reals = tuple(k for k, kind in enumerate(kinds) if id(kind) in real_types)
    integers = tuple(k for k, kind in enumerate(kinds) if id(kind) in integer_types)
    unsigned = any(kinds[k] in (language.u8, language.u16, language.u32, language.u64) for k in integers)
    if unusual or unsigned or len(arrays) + len(reals) + len(integers) != len(kinds):
        return None
    flat = all(slot.member is None for slot in slots)

    def launch(*given: Any) -> None:
        arguments = given if flat else _flattened(slots, given)
        context = prepared.make_launch_context()
        if reals:
            context.set_args_float(reals, tuple([float(arguments[k]) for k in reals]))
        if integers:
            context.set_args_int(integers, tuple([int(arguments[k]) for k in integers]))
        if arrays:
            context.set_args_ndarray(arrays, tuple([arguments[k].arr for k in arrays]))
        program.launch_kernel(compiled, context)

    return launch


class _Slot(NamedTuple):
    """An argument as the compiled kernel takes it.

    Attributes:
        argument: number of the argument in Python.
        member: its member that is meant, nothing for the argument itself.
        kind: annotation.
    """

    argument: int
    member: str | None
    kind: Any


def _slots(asked: Sequence[Any], used: Collection[str]) -> list[_Slot]:
    """Return what a compiled kernel takes: of a struct of arrays each member that the kernel uses.

    Args:
        asked: the language's descriptions of the arguments.
        used: the language's names of the members that are used.
    """
    found: list[_Slot] = []
    for k, argument in enumerate(asked):
        if is_dataclass(argument.annotation):
            members = (m for m in fields(argument.annotation) if f"__qd_{argument.name}__qd_{m.name}" in used)
            found.extend(_Slot(k, member.name, member.type) for member in members)
        else:
            found.append(_Slot(k, None, argument.annotation))
    return found


def _flattened(slots: Sequence[_Slot], given: Sequence[Any]) -> list[Any]:
    return [given[k] if member is None else getattr(given[k], member) for k, member, _ in slots]
