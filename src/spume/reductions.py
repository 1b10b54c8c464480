"""Sums and extremes over rows.

They are made of a fixed number of partial ones, whatever the number of threads, and leave ``lanes.REDUCED`` of each to
the processor: a kernel is called with its arrays, the partial results, what is left of them, a number that says which
rows are meant, and the number of rows.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from spume import kernels, lanes

OF_KIND = "kind[i] & choice != 0"
"""Rows whose kind is among those of ``choice``."""


def reduction_arrays(value: Any, width: int = 1) -> tuple[Any, Any]:
    """Return new arrays of such values, for the partial results and for what is left of them."""
    return kernels.array(value, width * lanes.reduction_blocks()), kernels.array(value, width * lanes.REDUCED)


@kernels.cached
def largest_kernel(d: int, serial: bool) -> Any:
    """Return the kernel that finds the square of the largest length of a vector field, over rows of some kinds."""
    arrays = {"field": kernels.vector(d), "kind": kernels.i32}
    return reduction("largest", arrays, ["no_nan(field[i].dot(field[i]))"], "0", "qd.max({}, {})", OF_KIND, serial)


@kernels.cached
def total_kernel(integer: bool, serial: bool) -> Any:
    """Return the kernel that sums a scalar field over rows of some kinds."""
    arrays = {"field": kernels.i32 if integer else kernels.runtime().real, "kind": kernels.i32}
    return reduction("total", arrays, ["field[i]"], "0", "{} + {}", OF_KIND, serial)


@kernels.cached
def extreme_kernel(largest: bool, serial: bool) -> Any:
    """Return the kernel that finds the smallest or the largest value of a scalar field, over rows of some kinds."""
    arrays = {"field": kernels.runtime().real, "kind": kernels.i32}
    join = "qd.max({}, {})" if largest else "qd.min({}, {})"
    return reduction("extreme", arrays, ["field[i]"], "-huge" if largest else "huge", join, OF_KIND, serial)


def reduction(
    name: str, arrays: Mapping[str, Any], values: Sequence[str], none: str, join: str, where: str, serial: bool,
    real: Any = None,
) -> Any:  # fmt: skip
    """Generate the kernel of a reduction.

    Args:
        name: its name.
        arrays: names and types of values of the arrays that it reads.
        values: texts of the values of row i, which are reduced beside each other. ``no_nan(x)`` is x, and the largest
            number for one that is none: that would vanish in a maximum.
        none: text of what no rows give; ``huge`` is the largest number.
        join: text that makes one of two values.
        where: text of the condition for row i to count; ``choice`` is a number of each call.
        serial: whether one thread works.
        real: type of the partial results; default: that of the run.
    """
    runtime = kernels.runtime()
    real, width = runtime.real if real is None else real, len(values)
    huge = float(np.finfo(runtime.dtype).max)
    blocks = lanes.reduction_blocks()

    @kernels.func
    def no_nan(x):  # type: ignore[no-untyped-def]
        found = x
        if not (x < huge):
            found = huge
        return found

    scope: dict[str, Any] = {
        "real": real, "huge": huge, "no_nan": no_nan, "serial": serial, "few": not runtime.wide, "blocks": blocks,
        "reduced": lanes.REDUCED,
        "share": blocks // lanes.REDUCED, "spread": 1 if serial else kernels.spread(blocks),
        "Partial": kernels.array_type(real), **{f"In_{n}": kernels.array_type(t) for n, t in arrays.items()},
    }  # fmt: skip
    own = range(width)
    begin = [f"s{k} = qd.cast({none}, real)" for k in own]
    lines = [
        f"def {name}({', '.join(f'{n}: In_{n}' for n in arrays)}, partial: Partial, result: Partial,",
        "           choice: qd.i32, count: qd.i32):",
        "    qd.loop_config(serialize=serial)",
        "    for t in range(blocks * spread):",
        "        if t % spread == 0:",
        "            b = t // spread",
        *[f"            {line}" for line in begin],
        "            for i in range(qd.cast(qd.cast(count, qd.i64) * b // blocks, qd.i32),",
        "                           qd.cast(qd.cast(count, qd.i64) * (b + 1) // blocks, qd.i32)):",
        f"                if {where}:",
        *[f"                    s{k} = {join.format(f's{k}', f'qd.cast({values[k]}, real)')}" for k in own],
        *[f"            partial[{width} * b + {k}] = s{k}" for k in own],
        "    qd.loop_config(serialize=few)",
        "    for c in range(reduced):",
        *[f"        {line}" for line in begin],
        "        for m in range(share):",
        *[f"            s{k} = {join.format(f's{k}', f'partial[{width} * (c + m * reduced) + {k}]')}" for k in own],
        *[f"        result[{width} * c + {k}] = s{k}" for k in own],
    ]
    return kernels.compiled(name, "\n".join(lines) + "\n", **scope)
