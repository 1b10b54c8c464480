"""Neighbour pairs and the only loops over them: ``pair_sum``, ``pair_min`` and ``pair_max``.

A *pair term* states one formula for a pair of rows and takes values, not row numbers::

    @pair_term(reads=("pressure",))
    def difference(a, b, r, w):
        return (b.pressure - a.pressure) * r / r.dot(r) * w

``a`` and ``b`` hold the declared fields of the row and of its neighbour, ``r`` is the vector from
a to b [m] (through a periodic boundary where that is nearer) and ``w`` the weight W(|r|, re). A field
that is not declared is not there: reading it does not compile.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from spume import kernels
from spume.particles import ANY, FLUID, Particles
from spume.search import NeighbourList


@dataclass(frozen=True)
class PairTerm:
    """One formula per pair, with the fields that it reads and the shape of its value.

    ``finish(a, total, *arguments)`` turns the sum of a row into the row's value.
    """

    formula: Callable[..., Any]
    reads: tuple[str, ...]
    shape: tuple[str, ...]
    finish: Callable[..., Any] | None = None

    @property
    def name(self) -> str:
        """Name of the formula."""
        return str(self.formula.__name__)


def pair_term(
    reads: Sequence[str] = (), shape: tuple[str, ...] = (), finish: Callable[..., Any] | None = None
) -> Callable[[Callable[..., Any]], PairTerm]:
    """Declare a formula ``term(a, b, r, w, *arguments)`` for pairs of rows.

    Args:
        reads: names of the fields that ``a`` and ``b`` hold.
        shape: shape of the formula's value: () scalar, ("d",) vector, ("d", "d") tensor.
        finish: optional ``finish(a, total, *arguments)``, applied to each row's sum.
    """

    def decorate(formula: Callable[..., Any]) -> PairTerm:
        return PairTerm(kernels.func(formula), tuple(reads), shape, None if finish is None else kernels.func(finish))

    return decorate


@dataclass(frozen=True)
class RowTerm:
    """One formula per row, with the fields that it reads."""

    formula: Callable[..., Any]
    reads: tuple[str, ...]


@dataclass(frozen=True)
class PairView:
    """How a row sees a neighbour: ``formula(a, b, r, *arguments)`` replaces one value of b.

    A wall model supplies what a solid row stands for in this way, and no term knows of walls.

    Attributes:
        formula: function of the kernel language, made with ``kernels.func``.
        reads: fields of a and b that it needs.
        value: name of the value of b that it replaces.
        arguments: numbers that follow r.
    """

    formula: Callable[..., Any]
    reads: tuple[str, ...]
    value: str = "value"
    arguments: tuple[float, ...] = ()


def row_term(reads: Sequence[str] = ()) -> Callable[[Callable[..., Any]], RowTerm]:
    """Declare a formula ``term(a, *arguments)`` for single rows."""
    return lambda formula: RowTerm(kernels.func(formula), tuple(reads))


class Pairs:
    """Pairs of rows nearer than a radius, kept up to date as the rows move.

    Args:
        radius: largest effective radius of any operator [m].
        skin: extra distance kept in the list, so that it serves several steps [m].
        lower, upper: the region that rows may be in [m]; a row that leaves it is removed and counted.
        periodic: for each axis, whether ``lower`` and ``upper`` are joined there.
    """

    def __init__(
        self,
        radius: float,
        skin: float,
        lower: Sequence[float],
        upper: Sequence[float],
        periodic: Sequence[bool] | None = None,
    ) -> None:
        self.periodic = tuple(bool(p) for p in (periodic or [False] * len(lower)))
        self.list = NeighbourList(radius, skin, np.asarray(lower, float), np.asarray(upper, float), self.periodic)

    @property
    def builds(self) -> int:
        """How many times the list was built."""
        return self.list.builds

    def update(self, particles: Particles) -> int:
        """Make the list valid for the present positions; return how many rows left the region."""
        particles.written("position")  # whoever moved rows, in whatever way, asks for an update
        return self.list.update(particles)


def pair_sum(
    terms: PairTerm | Sequence[PairTerm],
    particles: Particles,
    pairs: Pairs,
    *,
    out: str | Sequence[str],
    weight: Any,
    re: float,
    rows: int = FLUID,
    over: int = ANY,
    arguments: Sequence[float] = (),
    fields: Mapping[str, str] | None = None,
    view: PairView | None = None,
) -> None:
    """Sum terms over neighbours nearer than ``re`` and write one value per row.

    Args:
        terms: one term or several, which then share one pass over the list.
        out: field that receives each term's sum; rows of other kinds than ``rows`` keep theirs.
        weight: weight function W(r, re) (a ``Weight`` scheme).
        re: effective radius [m].
        rows: kinds of the rows that sum.
        over: kinds of the neighbours that are summed over.
        arguments: numbers handed to every term after ``w`` (they may change without recompiling).
        view: how a row sees a neighbour, if not as its fields say.
        fields: field that stands behind a name which a term reads (``{"value": "pressure"}``).
    """
    _reduce("sum", terms, particles, pairs, out, weight, re, rows, over, arguments, fields, view)


def pair_min(
    terms: PairTerm | Sequence[PairTerm],
    particles: Particles,
    pairs: Pairs,
    *,
    out: str | Sequence[str],
    weight: Any,
    re: float,
    rows: int = FLUID,
    over: int = ANY,
    arguments: Sequence[float] = (),
    fields: Mapping[str, str] | None = None,
    view: PairView | None = None,
) -> None:
    """Write for each row the smallest scalar term over its neighbours (+inf without any); see ``pair_sum``."""
    _reduce("min", terms, particles, pairs, out, weight, re, rows, over, arguments, fields, view)


def pair_max(
    terms: PairTerm | Sequence[PairTerm],
    particles: Particles,
    pairs: Pairs,
    *,
    out: str | Sequence[str],
    weight: Any,
    re: float,
    rows: int = FLUID,
    over: int = ANY,
    arguments: Sequence[float] = (),
    fields: Mapping[str, str] | None = None,
    view: PairView | None = None,
) -> None:
    """Write for each row the largest scalar term over its neighbours (-inf without any); see ``pair_sum``."""
    _reduce("max", terms, particles, pairs, out, weight, re, rows, over, arguments, fields, view)


def row_map(
    term: RowTerm,
    particles: Particles,
    *,
    out: str,
    rows: int = FLUID,
    arguments: Sequence[float] = (),
    fields: Mapping[str, str] | None = None,
    dry: bool = False,
) -> None:
    """Write one term per row of the given kinds; ``arguments`` follow ``a``, ``fields`` as in ``pair_sum``.

    Solid rows that no fluid is near are left out, unless ``dry`` asks for them.
    """
    count = particles.count if dry else particles.active
    behind = fields or {}
    signature = _signature(particles, (*term.reads, out), behind)
    kernel = _row_kernel(term, out, rows, signature, len(arguments), kernels.light(count))
    inputs = [particles[behind.get(n, n)] for n in term.reads]
    kernel(particles["kind"], *inputs, particles[out], count, *arguments)
    particles.written(out)
    particles.traffic += count * particles.row_bytes(("kind", *(behind.get(n, n) for n in term.reads), out))


Signature = tuple[tuple[str, tuple[int, ...], bool], ...]


def _signature(particles: Particles, names: Sequence[str], behind: Mapping[str, str] | None = None) -> Signature:
    fields = {n: particles.fields[(behind or {}).get(n, n)] for n in names}
    return tuple((n, fields[n].value_shape(particles.dimension), fields[n].dtype is int) for n in names)


def _reduce(
    operation: str,
    terms: PairTerm | Sequence[PairTerm],
    particles: Particles,
    pairs: Pairs,
    out: str | Sequence[str],
    weight: Any,
    re: float,
    rows: int,
    over: int,
    arguments: Sequence[float],
    fields: Mapping[str, str] | None,
    view: PairView | None,
) -> None:
    terms = (terms,) if isinstance(terms, PairTerm) else tuple(terms)
    outs = (out,) if isinstance(out, str) else tuple(out)
    if len(terms) != len(outs):
        raise ValueError(f"{len(terms)} terms, but {len(outs)} fields to write: {outs}")
    seen = view.reads if view else ()
    reads = tuple(dict.fromkeys([*(n for t in terms for n in t.reads), *seen]))
    behind = fields or {}
    signature = _signature(particles, (*reads, *outs), behind)
    list_ = pairs.list
    kernel = _pair_kernel(
        operation, terms, outs, signature, weight.function(), rows, over,
        particles.dimension, pairs.periodic, len(arguments), view.formula if view else None, reads,
        view.value if view else "", len(view.arguments) if view else 0,
        over != ANY or view is not None or re < 0.75 * list_.radius,
    )  # fmt: skip
    for chunk in list_.chunks:
        kernel(
            particles["position"], particles["kind"], list_.start, list_.length, chunk.neighbour,
            *[particles[behind.get(n, n)] for n in reads], *[particles[n] for n in outs],
            chunk.begin, chunk.end, re, *list_.period, *arguments, *(view.arguments if view else ()),
        )  # fmt: skip
    particles.written(*outs)
    touched = ("position", "kind", *(behind.get(n, n) for n in reads), *outs)
    particles.traffic += particles.active * (12 + particles.row_bytes(touched))
    particles.visits += 1


def load(signature: Signature, reads: Sequence[str]) -> tuple[Any, str]:
    """Return a struct type of the fields read and the text that loads it for the row ``{row}``."""
    types = {n: kernels.value_type(shape, integer) for n, shape, integer in signature}
    if not reads:
        return kernels.struct(nothing=kernels.i32), "Row(nothing=0)"
    row = kernels.struct(**{n: types[n] for n in reads})
    return row, "Row(" + ", ".join(f"{n}=in_{n}[{{row}}]" for n in reads) + ")"


def minimum_image(periodic: Sequence[bool]) -> list[str]:
    """Return the statements that replace ``r`` by its shortest periodic image."""
    return [f"r[{k}] -= period{k} * qd.round(r[{k}] / period{k})" for k, joined in enumerate(periodic) if joined]


@kernels.cached
def _pair_kernel(
    operation: str,
    terms: tuple[PairTerm, ...],
    outs: tuple[str, ...],
    signature: Signature,
    weight: Any,
    rows: int,
    over: int,
    d: int,
    periodic: tuple[bool, ...],
    n_arguments: int,
    view: Callable[..., Any] | None,
    reads: tuple[str, ...],
    viewed: str,
    n_view_arguments: int,
    selective: bool,
) -> Any:
    """Generate the loop over rows and neighbours for a set of terms; ``selective`` if it leaves out many pairs."""
    Row, loading = load(signature, reads)
    types = {n: kernels.value_type(shape, integer) for n, shape, integer in signature}
    arguments = [f"argument{k}" for k in range(n_arguments)]
    scope: dict[str, Any] = {
        "Row": Row, "weight": weight, "real": kernels.runtime().real, "serial": kernels.runtime().serial,
        "Vectors": kernels.array_type(kernels.vector(d)), "Starts": kernels.array_type(kernels.i64),
        "Rows": kernels.array_type(kernels.i32),
    }  # fmt: skip
    parameters = ["position: Vectors", "kind: Rows", "start: Starts", "length: Rows", "neighbour: Rows"]
    for n in reads:
        scope[f"In_{n}"] = kernels.array_type(types[n])
        parameters.append(f"in_{n}: In_{n}")
    for n in outs:
        scope[f"Out_{n}"] = kernels.array_type(types[n])
        parameters.append(f"out_{n}: Out_{n}")
    parameters += ["begin: qd.i32", "end: qd.i32", "re: real"]
    parameters += [f"period{k}: real" for k in range(d)] + [f"{a}: real" for a in arguments]
    more = "".join(f", {a}" for a in arguments)
    view_arguments = [f"view_argument{k}" for k in range(n_view_arguments)]
    parameters += [f"{a}: real" for a in view_arguments]
    seeing = [f"b.{viewed} = view(a, b, r{''.join(', ' + a for a in view_arguments)})"] if view else []
    scope["view"] = view

    begin, combine, skipped, end = [], [], [], []
    for k, (term, out) in enumerate(zip(terms, outs, strict=True)):
        scope[f"term{k}"], scope[f"finish{k}"] = term.formula, term.finish
        zero = types[out]
        scope[f"Value{k}"] = zero
        shape = next(s for n, s, _ in signature if n == out)
        if operation == "sum":
            # A scalar cast makes the accumulator's type that of the field, whatever the term returns.
            begin.append(f"s{k} = qd.cast(0, real)" if shape == () else f"s{k} = Value{k}(0.0)")
            combine.append(f"s{k} += term{k}(a, b, r, w{more})")
            skipped.append(f"s{k} += qd.select(near, term{k}(a, b, r, w{more}), 0)")
        else:
            begin.append(f"s{k} = qd.cast({'' if operation == 'min' else '-'}infinity, real)")
            combine.append(f"s{k} = qd.{operation}(s{k}, term{k}(a, b, r, w{more}))")
            none = f"qd.cast({'' if operation == 'min' else '-'}infinity, real)"
            skipped.append(f"s{k} = qd.{operation}(s{k}, qd.select(near, term{k}(a, b, r, w{more}), {none}))")
        value = f"s{k}" if term.finish is None else f"finish{k}(a, s{k}{more})"
        end.append(f"out_{out}[i] = {value}")
    scope["infinity"] = float(np.finfo(kernels.runtime().dtype).max)
    evaluate = [f"b = {loading.format(row='j')}", *seeing, "w = weight(qd.sqrt(rr), re)"]
    distance = ["r = position[j] - x", *minimum_image(periodic), "rr = r.dot(r)"]
    if selective:
        body = [
            f"if kind[j] & {over} != 0:",
            *[f"    {line}" for line in distance],
            "    if rr < re * re:",
            *[f"        {line}" for line in (*evaluate, *combine)],
        ]
    else:
        # Nearly every pair counts. Without a branch the loop becomes vector instructions, up to 1.5 times as fast.
        body = [*distance, "near = rr < re * re", *evaluate, *skipped]
    lines = [
        f"def pair_{operation}({', '.join(parameters)}):",
        "    qd.loop_config(serialize=serial)",
        "    for i in range(begin, end):",
        f"        if kind[i] & {rows} != 0:",
        f"            a = {loading.format(row='i')}",
        *[f"            {line}" for line in begin],
        "            first = start[i]",
        "            x = position[i]",
        "            for k in range(length[i]):",
        "                j = neighbour[first + k]",
        *[f"                {line}" for line in body],
        *[f"            {line}" for line in end],
    ]
    return kernels.compiled(f"pair_{operation}", "\n".join(lines) + "\n", **scope)


@kernels.cached
def _row_kernel(term: RowTerm, out: str, rows: int, signature: Signature, n_arguments: int, serial: bool) -> Any:
    """Generate the loop over rows for a row term."""
    Row, loading = load(signature, term.reads)
    types = {n: kernels.value_type(shape, integer) for n, shape, integer in signature}
    arguments = [f"argument{k}" for k in range(n_arguments)]
    scope: dict[str, Any] = {
        "Row": Row, "term": term.formula, "real": kernels.runtime().real, "serial": serial,
        "Rows": kernels.array_type(kernels.i32), "Out": kernels.array_type(types[out]),
    }  # fmt: skip
    parameters = ["kind: Rows"]
    for n in term.reads:
        scope[f"In_{n}"] = kernels.array_type(types[n])
        parameters.append(f"in_{n}: In_{n}")
    parameters += ["out: Out", "count: qd.i32", *[f"{a}: real" for a in arguments]]
    lines = [
        f"def row_map({', '.join(parameters)}):",
        "    qd.loop_config(serialize=serial)",
        "    for i in range(count):",
        f"        if kind[i] & {rows} != 0:",
        f"            a = {loading.format(row='i')}",
        f"            out[i] = term(a{''.join(', ' + a for a in arguments)})",
    ]
    return kernels.compiled("row_map", "\n".join(lines) + "\n", **scope)
