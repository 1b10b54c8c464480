"""Launching kernels without the questions that the kernel language asks at every call.

A call of a kernel costs it about 40 µs on one core of 2026 whatever the kernel does, of which the launch itself takes
6: it looks at the type of each argument, hashes the arguments and looks them up. A step makes some 80 calls, most of
them the same as in the step before but for numbers, so what the first call found out is kept.
"""

from collections.abc import Callable
from typing import Any


def launcher(kernel: Any, language: Any) -> Callable[..., Any]:
    """Return a function that launches a kernel of arrays and numbers as its first call did, only sooner.

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
        annotations = [argument.annotation for argument in made.arg_metas]
        prepared, compiled = made.materialized_kernels[key], made.compiled_kernel_data_by_key[key]
        unusual = made.return_type or made.has_print or made.use_graph or made.use_checkpoints
        program = language.lang.impl.get_runtime().prog
    except (AttributeError, KeyError):
        return None
    arrays = tuple(k for k, kind in enumerate(annotations) if isinstance(kind, array_type))
    reals = tuple(k for k, kind in enumerate(annotations) if id(kind) in real_types)
    integers = tuple(k for k, kind in enumerate(annotations) if id(kind) in integer_types)
    unsigned = any(annotations[k] in (language.u8, language.u16, language.u32, language.u64) for k in integers)
    if unusual or unsigned or len(arrays) + len(reals) + len(integers) != len(annotations):
        return None

    def launch(*arguments: Any) -> None:
        context = prepared.make_launch_context()
        if reals:
            context.set_args_float(reals, tuple([float(arguments[k]) for k in reals]))
        if integers:
            context.set_args_int(integers, tuple([int(arguments[k]) for k in integers]))
        if arrays:
            context.set_args_ndarray(arrays, tuple([arguments[k].arr for k in arrays]))
        program.launch_kernel(compiled, context)

    return launch
