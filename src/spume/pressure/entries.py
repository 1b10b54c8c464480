"""Entries of a matrix, in as many arrays as they need: a chunk of rows has its columns and values in arrays of its own.

Kernels are compiled for the number of chunks. With one they read the only array; with more, a row first asks which
chunk it is in, and its sum then runs over that chunk's arrays: in the same order, so to the same bits.
"""

from dataclasses import dataclass, make_dataclass
from types import SimpleNamespace
from typing import Any

from spume import kernels, lanes


@dataclass(frozen=True)
class Entries:
    """How the entries of a matrix are stored, which is what kernels that read them are compiled for.

    Attributes:
        value: type of the values.
        chunks: number of chunks; all but the last have the same number of rows.
    """

    value: Any
    chunks: int = 1


SINGLES = Entries(kernels.f32)
"""The storage of coarse levels."""


def arrays(chunk: int) -> tuple[str, str]:
    """Return the names of a chunk's arrays, the members that hold its columns and its values."""
    return f"column{chunk or ''}", f"value{chunk or ''}"


@kernels.cached
def matrix_type(entries: Entries) -> Any:
    """Return the type that holds a matrix, as an argument of kernels or the base of one."""
    Rows, Values = kernels.array_type(kernels.i32), kernels.array_type(entries.value)
    members = {"start": Rows, "length": Rows}  # first slot in the row's chunk, entries beside the diagonal
    for chunk in range(entries.chunks):
        members |= dict(zip(arrays(chunk), (Rows, Values), strict=True))
    if entries.chunks > 1:
        members["rows_of_chunk"] = kernels.i32
    return make_dataclass("Matrix", members.items())


def _by_chunk(entries: Entries, lines: list[str]) -> list[str]:
    """Return statements for the arrays ``column`` and ``value`` of the chunk of that number."""
    found = []
    for chunk in range(entries.chunks):
        column, value = arrays(chunk)
        mine = [line.format(column=f"matrix.{column}", value=f"matrix.{value}") for line in lines]
        if entries.chunks == 1:
            return mine
        found += [f"if chunk == {chunk}:", *[f"    {line}" for line in mine]]
    return found


@kernels.cached
def row_sum(struct: Any, entries: Entries, sign: str, real: Any, vector: Any) -> Any:
    """Return the function (matrix, i, at, x, s) that adds the entries of row i, times values of x, to s.

    Args:
        struct: type of ``matrix``, a `matrix_type` or one made of it.
        sign: ``+`` or ``-``: whether they are added or subtracted.
        real: type of the sum.
        vector: type of the values of x; that of column j stands at ``at + j``.
    """
    stride = lanes.stride()
    slot = "k" if stride == 1 else f"first + k * {stride}"
    lines = [
        "def row_sum(matrix: Matrix, i: qd.i32, at: qd.i32, x: Vector, s: real):",
        "    total = s",
        "    first = matrix.start[i]",
        "    last = first + matrix.length[i]",
        "    chunk = i // matrix.rows_of_chunk" if entries.chunks > 1 else "",
        *[
            f"    {line}"
            for line in _by_chunk(
                entries,
                [
                    "for k in range(first, last):" if stride == 1 else "for k in range(matrix.length[i]):",
                    f"    total {sign}= qd.cast({{value}}[{slot}], real) * x[at + {{column}}[{slot}]]",
                ],
            )
        ],
        "    return total",
    ]
    return kernels.compiled_function(
        "row_sum", "\n".join(lines) + "\n", Matrix=struct, Vector=kernels.array_type(vector), real=real
    )


@kernels.cached
def entry_functions(struct: Any, entries: Entries) -> SimpleNamespace:
    """Return the functions ``chunk(matrix, i)`` of a row and ``column``, ``value`` (matrix, chunk, k) of a slot."""
    scope = {"Matrix": struct, "entry": entries.value}
    found = {}
    chunk = "i // matrix.rows_of_chunk" if entries.chunks > 1 else "0"
    found["chunk"] = kernels.compiled_function(
        "chunk", f"def chunk(matrix: Matrix, i: qd.i32):\n    return {chunk}\n", **scope
    )
    for name, kind in (("column", "qd.i32"), ("value", "entry")):
        lines = [
            f"def {name}(matrix: Matrix, chunk: qd.i32, k: qd.i32):",
            f"    found = qd.cast(0, {kind})",
            *[f"    {line}" for line in _by_chunk(entries, [f"found = {{{name}}}[k]"])],
            "    return found",
        ]
        found[name] = kernels.compiled_function(name, "\n".join(lines) + "\n", **scope)
    return SimpleNamespace(**found)
