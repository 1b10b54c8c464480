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

from spume import kernels, lanes
from spume.particles import ANY, DUMMY, FLUID, SOLID, WALL, Particles, Signature
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


_LARGEST_INTEGER = 2_000_000_000
"""Less than the largest, which single precision would round up."""


@dataclass(frozen=True)
class PairView:
    """How a row sees a neighbour: ``formula(a, b, r, *arguments)`` replaces one value of b.

    A wall model supplies what a solid row stands for in this way, and no term knows of walls.

    Attributes:
        formula: function of the kernel language, made with ``kernels.func``.
        reads: fields of a and b that it needs.
        value: name of the value of b that it replaces.
        arguments: numbers that follow r.
        of_normals: whether what it says of a solid row is meant along the normal of the row's wall alone.
        beyond_rest: whether that holds for what differs from fluid at rest, rho wall_acceleration . r, and no more.
    """

    formula: Callable[..., Any]
    reads: tuple[str, ...]
    value: str = "value"
    arguments: tuple[float, ...] = ()
    of_normals: bool = False
    beyond_rest: bool = False


@dataclass(frozen=True)
class PairSum:
    """A sum over pairs that is yet to be made, with what `pair_sum` would be told; equal ones give equal values.

    Attributes:
        terms, out: the terms, and the field that receives each one's sum.
        weight, re: weight function and effective radius [m].
        rows, over: kinds of the rows that sum, and of the neighbours summed over.
        arguments: numbers handed to every term.
        fields: names that the terms read, each with the field that stands behind it.
    """

    terms: tuple[PairTerm, ...]
    out: tuple[str, ...]
    weight: Any
    re: float
    rows: int = FLUID
    over: int = ANY
    arguments: tuple[float, ...] = ()
    fields: tuple[tuple[str, str], ...] = ()

    @property
    def made_of(self) -> tuple[str, ...]:
        """Names of the fields that the sum depends on."""
        behind = dict(self.fields)
        return tuple(dict.fromkeys(("position", *(behind.get(n, n) for term in self.terms for n in term.reads))))


@dataclass(frozen=True)
class RowMap:
    """One term per row that is yet to be written, with what `row_map` would be told.

    Attributes:
        term: the term.
        out: field that receives it.
        rows: kinds of the rows that get one.
        arguments: numbers handed to the term.
        where: name of a scalar field that is positive at the rows that get one.
    """

    term: RowTerm
    out: str
    rows: int = FLUID
    arguments: tuple[float, ...] = ()
    where: str = ""


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

    @property
    def periods(self) -> dict[int, float]:
        """Length of the period of each periodic axis [m]."""
        lower, upper = self.list.lower, self.list.upper
        return {k: float(upper[k] - lower[k]) for k, joined in enumerate(self.periodic) if joined}

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
    where: str = "",
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
        where: name of a scalar field; only rows where it is positive sum, the others keep what they have.
    """
    sums = (_asked(terms, out, weight, re, rows, over, arguments),)
    _reduce("sum", sums, particles, pairs, fields, view, where)


def pair_sums(sums: Sequence[PairSum], particles: Particles, pairs: Pairs) -> None:
    """Make several sums in one pass over the list, each once, without those that their fields hold already.

    A sum is kept as long as nobody writes its field, the positions, or a field that its terms read. What one sum calls
    by another name than its field, no other sum of the pass may read by that name.
    """
    missing = [s for s in dict.fromkeys(sums) if not all(particles.keeps(n, (s,), s.made_of) for n in s.out)]
    if missing:
        _reduce("sum", tuple(missing), particles, pairs, dict(f for s in missing for f in s.fields), None)
    for s in missing:
        for n in s.out:
            particles.keep(n, (s,), s.made_of)


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
    """Write for each row the smallest scalar term over its neighbours; see ``pair_sum``.

    Without any it is the largest number, in a field of integers 2e9.
    """
    sums = (_asked(terms, out, weight, re, rows, over, arguments),)
    _reduce("min", sums, particles, pairs, fields, view)


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
    where: str = "",
) -> None:
    """Write for each row the largest scalar term over its neighbours; see ``pair_sum``.

    Without any it is the largest number with a minus, in a field of integers -2e9.
    """
    sums = (_asked(terms, out, weight, re, rows, over, arguments),)
    _reduce("max", sums, particles, pairs, fields, view, where)


def row_map(
    term: RowTerm,
    particles: Particles,
    *,
    out: str,
    rows: int = FLUID,
    arguments: Sequence[float] = (),
    fields: Mapping[str, str] | None = None,
    dry: bool = False,
    where: str = "",
) -> None:
    """Write one term per row of the given kinds; ``arguments`` follow ``a``, the rest as in ``pair_sum``.

    Solid rows that no fluid is near are left out, unless ``dry`` asks for them.
    """
    _map((RowMap(term, out, rows, tuple(arguments), where),), particles, fields or {}, dry)


def row_maps(maps: Sequence[RowMap], particles: Particles) -> None:
    """Write several terms in one loop over the rows: each reads what those before it wrote to its row."""
    _map(tuple(maps), particles, {}, dry=False)


def _map(maps: tuple[RowMap, ...], particles: Particles, behind: Mapping[str, str], dry: bool) -> None:
    count = particles.count if dry else particles.active
    names = tuple(dict.fromkeys(n for m in maps for n in (*m.term.reads, m.out, *([m.where] if m.where else []))))
    parts = tuple((m.term, m.out, m.rows, len(m.arguments), m.where) for m in maps)
    kernel = _row_kernel(parts, particles.signature(names, behind), kernels.light(count))
    kernel(
        particles["kind"], *[particles[behind.get(n, n)] for n in names], count, *[x for m in maps for x in m.arguments]
    )
    particles.written(*[behind.get(m.out, m.out) for m in maps])
    particles.traffic += count * particles.row_bytes(dict.fromkeys(("kind", *(behind.get(n, n) for n in names))))


ROW_BITS = 0x1FFFFFFF
"""Mask of row numbers, which changes none: it tells the compiler that three times one, and two, is an integer still.

All components of a neighbour's vector are then loaded from one address.
"""


_RARE = 0.3
"""Part of the list's radius below which hardly a row has a neighbour: pairs are then counted before they are summed."""


def _asked(
    terms: PairTerm | Sequence[PairTerm], out: str | Sequence[str], weight: Any, re: float, rows: int, over: int,
    arguments: Sequence[float],
) -> PairSum:  # fmt: skip
    terms = (terms,) if isinstance(terms, PairTerm) else tuple(terms)
    outs = (out,) if isinstance(out, str) else tuple(out)
    if len(terms) != len(outs):
        raise ValueError(f"{len(terms)} terms, but {len(outs)} fields to write: {outs}")
    return PairSum(terms, outs, weight, re, rows, over, tuple(arguments))


@dataclass(frozen=True)
class _Part:
    """One sum of a pass as its kernel is compiled: whatever may change without recompiling is left out."""

    terms: tuple[PairTerm, ...]
    outs: tuple[str, ...]
    weight: Any
    radius: int
    rows: int
    over: int
    n_arguments: int
    rare: bool


def _reduce(
    operation: str,
    sums: Sequence[PairSum],
    particles: Particles,
    pairs: Pairs,
    fields: Mapping[str, str] | None,
    view: PairView | None,
    where: str = "",
) -> None:
    outs = [n for s in sums for n in s.out]
    seen = view.reads if view else ()
    reads = tuple(dict.fromkeys([*(n for s in sums for t in s.terms for n in t.reads), *seen]))
    behind = fields or {}
    signature = particles.signature((*reads, *outs), behind)
    radii = tuple(dict.fromkeys(s.re for s in sums))
    list_ = pairs.list
    parts = tuple(
        _Part(
            s.terms, s.out, s.weight.function(), radii.index(s.re), s.rows, s.over, len(s.arguments),
            s.re < _RARE * list_.radius,
        )
        for s in sums
    )  # fmt: skip
    kernel = _pair_kernel(
        operation, parts, signature, particles.dimension, pairs.periodic, view.formula if view else None, reads,
        shared(reads, particles, behind),
        view.value if view else "", len(view.arguments) if view else 0, max(radii) < 0.75 * list_.radius, bool(where),
    )  # fmt: skip
    for chunk in list_.chunks:
        kernel(
            particles["position"], particles["kind"], list_.start, list_.length, list_.fluid, chunk.neighbour,
            *([particles[where]] if where else []),
            *[particles[behind.get(n, n)] for n in reads], *[particles[n] for n in outs],
            chunk.begin, chunk.end, *radii, *list_.period, *[a for s in sums for a in s.arguments],
            *(view.arguments if view else ()),
        )  # fmt: skip
    particles.written(*outs)
    touched = ("position", "kind", *(behind.get(n, n) for n in reads), *outs)
    particles.traffic += particles.active * (12 + particles.row_bytes(touched))
    particles.visits += 1


def shared(reads: Sequence[str], particles: Particles, behind: Mapping[str, str]) -> tuple[str, ...]:
    """Return which of the names read stand for a number that all rows have: a neighbour's is the row's own."""
    return tuple(n for n in reads if particles.uniform(behind.get(n, n)))


def load(signature: Signature, reads: Sequence[str], common: Sequence[str] = ()) -> tuple[Any, str]:
    """Return a struct type of the fields read and the text that loads it for the row ``{row}``.

    Values of ``common`` are taken from ``a``, the row that looks at this one.
    """
    types = {n: kernels.value_type(shape, integer) for n, shape, integer in signature}
    if not reads:
        return kernels.struct(nothing=kernels.i32), "Row(nothing=0)"
    row = kernels.struct(**{n: types[n] for n in reads})
    return row, "Row(" + ", ".join(f"{n}=a.{n}" if n in common else f"{n}=in_{n}[{{row}}]" for n in reads) + ")"


def slot(first: str, k: str) -> str:
    """Return the text of the slot of a row's neighbour number ``k``, ``first`` being that of its first."""
    return f"{first} + {k}" + (f" * {lanes.stride()}" if lanes.stride() > 1 else "")


def minimum_image(periodic: Sequence[bool]) -> list[str]:
    """Return the statements that replace ``r`` by its shortest periodic image."""
    return [f"r[{k}] -= period{k} * qd.round(r[{k}] / period{k})" for k, joined in enumerate(periodic) if joined]


@kernels.cached
def _pair_kernel(
    operation: str,
    parts: tuple[_Part, ...],
    signature: Signature,
    d: int,
    periodic: tuple[bool, ...],
    view: Callable[..., Any] | None,
    reads: tuple[str, ...],
    common: tuple[str, ...],
    viewed: str,
    n_view_arguments: int,
    selective: bool,
    where: bool,
) -> Any:
    """Generate the loop over rows and neighbours; ``selective`` if the radii leave out many pairs.

    ``common`` names the values read that all rows share.
    """
    Row, loading = load(signature, reads)
    _, loading_neighbour = load(signature, reads, common)
    types = {n: kernels.value_type(shape, integer) for n, shape, integer in signature}
    real = kernels.runtime().real
    scope: dict[str, Any] = {
        "Row": Row, "real": real, "serial": kernels.runtime().serial, "view": view,
        "Vectors": kernels.array_type(kernels.vector(d)), "Starts": kernels.array_type(kernels.i64),
        "Rows": kernels.array_type(kernels.i32), "Reals": kernels.array_type(real),
        "infinity": float(np.finfo(kernels.runtime().dtype).max),
    }  # fmt: skip
    parameters = ["position: Vectors", "kind: Rows", "start: Starts", "length: Rows", "fluid: Rows", "neighbour: Rows"]
    parameters += ["where: Reals"] * where
    for n in reads:
        scope[f"In_{n}"] = kernels.array_type(types[n])
        parameters.append(f"in_{n}: In_{n}")
    for n in (n for part in parts for n in part.outs):
        scope[f"Out_{n}"] = kernels.array_type(types[n])
        parameters.append(f"out_{n}: Out_{n}")
    parameters += ["begin: qd.i32", "end: qd.i32"]
    parameters += [f"re{k}: real" for k in range(1 + max(part.radius for part in parts))]
    parameters += [f"period{k}: real" for k in range(d)]
    parameters += [f"argument{p}_{k}: real" for p, part in enumerate(parts) for k in range(part.n_arguments)]
    view_arguments = [f"view_argument{k}" for k in range(n_view_arguments)]
    parameters += [f"{a}: real" for a in view_arguments]

    sign = {"sum": "0 *", "min": "", "max": "-"}[operation]
    begin: list[list[str]] = [[] for _ in parts]
    value: list[list[tuple[str, str]]] = [[] for _ in parts]
    end: list[list[str]] = [[] for _ in parts]
    for p, part in enumerate(parts):
        scope[f"weight{p}"] = part.weight
        more = "".join(f", argument{p}_{k}" for k in range(part.n_arguments))
        for k, (term, out) in enumerate(zip(part.terms, part.outs, strict=True)):
            s = f"s{p}_{k}"
            scope[f"term{p}_{k}"], scope[f"finish{p}_{k}"], scope[f"Value{p}_{k}"] = (
                term.formula,
                term.finish,
                types[out],
            )
            shape, integer = next((shape, integer) for n, shape, integer in signature if n == out)
            # What no integer can hold becomes any one: the largest stands for infinity.
            none = f"qd.cast({sign}{_LARGEST_INTEGER if integer else 'infinity'}, real)"
            # A scalar cast makes the accumulator's type that of the field, whatever the term returns.
            zero = "qd.cast(0, real)" if shape == () else f"Value{p}_{k}(0.0)"
            begin[p].append(f"{s} = {zero if operation == 'sum' else none}")
            value[p].append((s, f"term{p}_{k}(a, b, r, w{p}{more})"))
            end[p].append(f"out_{out}[i] = {s if term.finish is None else f'finish{p}_{k}(a, {s}{more})'}")

    def added(s: str, new: str) -> str:
        return f"{s} += {new}" if operation == "sum" else f"{s} = qd.{operation}({s}, {new})"

    stride = lanes.stride()

    def walk(chosen: list[int], first_slot: str, number: str, kinds: int) -> list[str]:
        """Return the loop of some sums over a part of a row's neighbours that are known to be of some kinds."""
        chosen = [p for p in chosen if parts[p].over & kinds]
        if not chosen:
            return []
        asked = {p: f"(kind[j] & {parts[p].over} != 0)" if kinds & ~parts[p].over else "" for p in chosen}
        neighbour = f"b = {loading_neighbour.format(row='j')}"
        if kinds == FLUID:
            # Once that is said, what serves walls is not even read.
            neighbour = neighbour.replace("kind=in_kind[j]", f"kind={FLUID}")
        seeing = [f"b.{viewed} = view(a, b, r{''.join(', ' + a for a in view_arguments)})"] if view else []
        prepare = [neighbour, *seeing, *[f"w{p} = weight{p}(qd.sqrt(rr), re{parts[p].radius})" for p in chosen]]
        distance = ["r = position[j] - x", *minimum_image(periodic), "rr = r.dot(r)"]
        lines = list(distance)
        first = chosen[0]
        if len(chosen) == 1 and (selective or asked[first]):
            lines += [f"if rr < re{parts[first].radius} * re{parts[first].radius}:"]
            lines += [f"    {line}" for line in (*prepare, *[added(s, new) for s, new in value[first]])]
            if asked[first]:
                lines = [f"if {asked[first]}:", *[f"    {line}" for line in lines]]
        else:
            # Nearly every pair counts: without a branch the loop becomes vector instructions.
            lines += prepare
            for p in chosen:
                near = f"rr < re{parts[p].radius} * re{parts[p].radius}"
                lines.append(f"near{p} = {f'({near}) & {asked[p]}' if asked[p] else near}")
                lines += [added(s, f"qd.select(near{p}, {new}, {none})") for s, new in value[p]]
        # Slots count up as the loop does, so that neighbours which follow each other are loaded together.
        looping = [f"for k in range({first_slot}, {first_slot} + {number}):", f"    j = neighbour[k] & {ROW_BITS}"]
        if stride > 1:
            looping = [f"for k in range({number}):", f"    j = neighbour[{slot(first_slot, 'k')}] & {ROW_BITS}"]
        loop = looping + [f"    {line}" for line in lines]
        if len(chosen) > 1 or not parts[first].rare:
            return loop
        # Counting has no branch that would be guessed wrong, and becomes vector instructions.
        square = f"re{parts[first].radius} * re{parts[first].radius}"
        counting = [*distance, f"near += qd.cast(rr < {square}, qd.i32)"]
        return [
            "near = 0",
            *looping,
            *[f"    {line}" for line in counting],
            "if near > 0:",
            *[f"    {s}" for s in loop],
        ]

    lines = [f"def pair_{operation}({', '.join(parameters)}):", "    qd.loop_config(serialize=serial)"]
    lines += ["    for i in range(begin, end):"]
    for kinds, chosen in _by_kind(parts):
        body = [f"a = {loading.format(row='i')}", *[line for p in chosen for line in begin[p]]]
        body += ["first = qd.cast(start[i], qd.i32)"]
        body += ["x = position[i]"]
        if view or "kind" in reads or any(parts[p].over != ANY for p in chosen):
            body += [f"middle = first + fluid[i] * {stride}"]
            body += walk(chosen, "first", "fluid[i]", FLUID)
            body += walk(chosen, "middle", "(length[i] - fluid[i])", SOLID)
        else:
            body += walk(chosen, "first", "length[i]", ANY)
        body += [line for p in chosen for line in end[p]]
        if where:
            body = ["if where[i] > 0:", *[f"    {line}" for line in body]]
        lines += [f"        if kind[i] & {kinds} != 0:", *[f"            {line}" for line in body]]
    return kernels.compiled(f"pair_{operation}", "\n".join(lines) + "\n", **scope)


def _by_kind(parts: Sequence[_Part]) -> list[tuple[int, list[int]]]:
    """Return kinds of rows, and which parts of a pass they sum."""
    found: dict[tuple[int, ...], int] = {}
    for kind in (FLUID, WALL, DUMMY):
        chosen = tuple(p for p, part in enumerate(parts) if part.rows & kind)
        if chosen:
            found[chosen] = found.get(chosen, 0) | kind
    return [(kinds, list(chosen)) for chosen, kinds in found.items()]


@kernels.cached
def _row_kernel(parts: tuple[tuple[RowTerm, str, int, int, str], ...], signature: Signature, serial: bool) -> Any:
    """Generate the loop over rows for row terms, each with its output, kinds, number of arguments and ``where``."""
    types = {n: kernels.value_type(shape, integer) for n, shape, integer in signature}
    scope: dict[str, Any] = {
        "real": kernels.runtime().real, "serial": serial, "Rows": kernels.array_type(kernels.i32),
        **{f"In_{n}": kernels.array_type(kind) for n, kind in types.items()},
    }  # fmt: skip
    parameters = ["kind: Rows", *[f"in_{n}: In_{n}" for n in types], "count: qd.i32"]
    body = []
    for p, (term, out, rows, n_arguments, where) in enumerate(parts):
        row, loading = load(signature, term.reads)
        scope |= {f"Row{p}": row, f"term{p}": term.formula}
        arguments = [f"argument{p}_{k}" for k in range(n_arguments)]
        parameters += [f"{a}: real" for a in arguments]
        body += [
            f"        if kind[i] & {rows} != 0{f' and in_{where}[i] > 0' if where else ''}:",
            f"            a{p} = {loading.replace('Row(', f'Row{p}(', 1).format(row='i')}",
            f"            in_{out}[i] = term{p}({', '.join((f'a{p}', *arguments))})",
        ]
    lines = [
        f"def row_map({', '.join(parameters)}):",
        "    qd.loop_config(serialize=serial)",
        "    for i in range(count):",
        *body,
    ]
    return kernels.compiled("row_map", "\n".join(lines) + "\n", **scope)
