"""Linear systems over the rows of the table, assembled from a Laplacian model.

A system states for each of its rows, with c_ij the coefficients of the Laplacian and k_ij what its equation makes of
a pair, sum_j k_ij c_ij (x_i - x_j) + diagonal_i x_i = right_i. Every row of the table has a state:

* UNKNOWN: its value is solved for;
* KNOWN: its value is given (free surface);
* FLUX: a solid row without an equation; what it imposes on its neighbours goes to the right side, for the pressure a
  known difference, P_j - P_i = rho_i wall_acceleration_j . r_ij (Neumann condition);
* ABSENT: it takes no part.

For the pressure k_ij is 1/rho_ij with the mean density of the pair, that of the row alone beside a solid row without
an equation, which is an image of the row whatever fluid it was in first; diagonal_i the draw of the free surface,
``surface_diagonal``, towards ``surface_value``, and right_i is -source_i.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse

from spume import kernels, lanes
from spume.lattice import Lattice
from spume.pairs import ROW_BITS, Pairs, PairView, Signature, load, minimum_image, shared
from spume.particles import ANY, Field, Particles
from spume.pressure.entries import Entries, arrays, matrix_type
from spume.schemes.laplacian.base import Laplacian, Terms

ABSENT, UNKNOWN, KNOWN, FLUX = 0, 1, 2, 3

WHOLLY_TIED = 100
"""What ``grounded`` counts for a row beside a known pressure, and for one that its whole diagonal ties."""

WALL_ACCELERATION = Field(
    "wall_acceleration", ("d",), "m/s^2", "solid rows: g - a_wall; times rho the imposed pressure gradient"
)

SYSTEM_FIELDS = (
    Field("row_state", (), "1", "0 absent, 1 unknown, 2 known, 3 known flux", int),
    Field("diagonal", (), "m/kg", "diagonal of the pressure matrix"),
    Field("rhs", (), "1/s^2", "right side of the pressure matrix"),
    Field("row_length", (), "1", "entries of a row beside the diagonal", int),
    WALL_ACCELERATION,
    Field("surface_diagonal", (), "m/kg", "addition to the diagonal by the free surface"),
    Field("surface_value", (), "Pa", "pressure to which the free surface draws a row"),
    Field("grounded", (), "1", "how much of a row's diagonal ties it to a known pressure, in hundredths", int),
)


@dataclass(frozen=True)
class Equation:
    """What a system states beside its Laplacian, as functions of the kernel language.

    Attributes:
        pair: k(a, b), the factor on a pair's coefficient.
        row: k(a), the factor on a coefficient of the row alone (missing neighbours).
        image: k(a), the factor on that of a FLUX neighbour; None: as on any pair's.
        diagonal, right: (a, *arguments), what the row has on the diagonal and on the right side.
        outside: (a), the value of missing neighbours; None: they do not count.
        known: (b), the value of a KNOWN neighbour.
        flux: (a, b, r), the known difference x_j - x_i (1 + flux_share) that a FLUX neighbour imposes.
        flux_share: (a, b, r), how much of x_i itself it takes off; None: nothing.
        pair_reads: fields of a and b that ``pair``, ``known`` and ``flux`` read.
        row_reads: fields of a that the others read.
        pair_of: fields of a and b of which ``pair`` is made, for a Laplacian that leans on a gradient.
    """

    pair: Callable[..., Any]
    row: Callable[..., Any]
    diagonal: Callable[..., Any]
    right: Callable[..., Any]
    outside: Callable[..., Any] | None
    known: Callable[..., Any]
    flux: Callable[..., Any]
    flux_share: Callable[..., Any] | None
    pair_reads: tuple[str, ...]
    row_reads: tuple[str, ...]
    image: Callable[..., Any] | None = None
    pair_of: tuple[str, ...] = ()


@kernels.func
def _specific_volume(a, b):  # type: ignore[no-untyped-def]
    # Of one fluid the same to the last bit. The maximum changes nothing but that no pair is divided for by itself.
    volume = max(1.0 / a.density, 0.0)
    if a.density != b.density:
        volume = 2.0 / (a.density + b.density)
    return volume


@kernels.func
def _own_volume(a):  # type: ignore[no-untyped-def]
    return 1.0 / a.density


@kernels.func
def _draw(a):  # type: ignore[no-untyped-def]
    return a.surface_diagonal


@kernels.func
def _source(a):  # type: ignore[no-untyped-def]
    return -a.source + a.surface_diagonal * a.surface_value


@kernels.func
def _surface_value(a):  # type: ignore[no-untyped-def]
    return a.surface_value


@kernels.func
def _pressure(b):  # type: ignore[no-untyped-def]
    return b.pressure


@kernels.func
def _imposed(a, b, r):  # type: ignore[no-untyped-def]
    return a.density * b.wall_acceleration.dot(r)


PRESSURE = Equation(
    pair=_specific_volume, row=_own_volume, diagonal=_draw, right=_source, outside=_surface_value, known=_pressure,
    flux=_imposed, flux_share=None, pair_reads=("density", "pressure", "wall_acceleration"),
    row_reads=("source", "surface_diagonal", "surface_value"), image=_own_volume, pair_of=("density",),
)  # fmt: skip
"""The pressure Poisson equation, div(grad(P)/rho) = source."""


@kernels.func
def across_densities(a, b):  # type: ignore[no-untyped-def]
    """Return P_i + 2 rho_i/(rho_i + rho_j) (P_j - P_i): how a row sees the pressure of a neighbour in another fluid."""
    value = b.value
    if a.density != b.density:
        value = a.value + 2.0 * a.density / (a.density + b.density) * (b.value - a.value)
    return value


@kernels.func
def _seen(a, b, r):  # type: ignore[no-untyped-def]
    return across_densities(a, b)


BETWEEN_FLUIDS = PairView(_seen, ("value", "density"))
"""Differences of pressure across an interface, as the pressure matrix counts them.

What is continuous there is grad(P)/rho, not grad(P): a gradient of these, divided by rho_i, is the acceleration that
the matrix, whose pairs have 2/(rho_i + rho_j), was solved for. In the sum P_i + P_j it is the pressure of the
interface, so that the forces of a pair stay equal and opposite."""


class LinearSystem:
    """A sparse matrix over the rows of the table, in compressed rows; only rows with an equation have entries.

    The rows are cut into the chunks of the list of neighbours: a row has no more entries than neighbours.
    One thread fills a stretch of rows, whose entries lie packed: with one thread all entries lie behind each other.
    On wide devices a row's entries lie in the slots of its neighbours, interleaved with those of other rows.

    Args:
        solution, state, diagonal, rhs, length, grounded: names of the fields that hold the system's values.
        single: whether coefficients are rounded to single precision, whatever that of the run, and stored so. The
            diagonal is then made of the rounded ones, in the run's precision: a system whose pairs have weights
            that differ by 6e-8, and whose products move two thirds of the bytes.

    Attributes:
        columns, values: row numbers of the entries beside the diagonal, and these, one array per chunk.
        start: first slot of each row in its chunk.
        symmetric: whether the matrix assembled last is symmetric.
        negligible: root mean square of the residual that may remain, in the unit of the right side.
    """

    def __init__(
        self, solution: str = "pressure", state: str = "row_state", diagonal: str = "diagonal", rhs: str = "rhs",
        length: str = "row_length", grounded: str = "grounded", *, single: bool = False,
    ) -> None:  # fmt: skip
        self.solution, self.state, self.diagonal = solution, state, diagonal
        self.rhs, self.length, self.grounded = rhs, length, grounded
        self.columns: list[Any] = []
        self.values: list[Any] = []
        self.start: Any = None
        self.symmetric = True
        self.negligible = 0.0
        self._single = single
        self._rows_of_chunk = 0
        self._sums = kernels.array(kernels.i64, 1)

    @property
    def real(self) -> Any:
        """The type of the entries in the kernel language."""
        return kernels.f32 if self._single else kernels.runtime().real

    @property
    def entries(self) -> Entries:
        """How the entries are stored: what kernels that read them are compiled for."""
        return Entries(self.real, len(self.columns))

    def members(self, particles: Particles) -> dict[str, Any]:
        """Return what the matrix is by the names that a `matrix_type` has for it."""
        found = {"start": self.start, "length": particles[self.length]}
        for chunk, (column, value) in enumerate(zip(self.columns, self.values, strict=True)):
            found |= dict(zip(arrays(chunk), (column, value), strict=True))
        return found | ({"rows_of_chunk": self._rows_of_chunk} if len(self.columns) > 1 else {})

    def matrix(self, particles: Particles) -> Any:
        """Return the matrix as an argument of kernels."""
        return matrix_type(self.entries)(**self.members(particles))

    def sparse(self, particles: Particles) -> scipy.sparse.csr_matrix:
        """Return the matrix in double precision, shape (rows, rows), with the diagonal of every row of the table."""
        n, length = particles.count, particles.numpy(self.length)
        start, first = self.start.to_numpy()[:n], 0
        columns, values = [], []
        for column, value in zip(self.columns, self.values, strict=True):
            here = slice(first, first + self._rows_of_chunk)
            slots = lanes.slots(start[here], length[here])
            columns.append(column.to_numpy()[slots])
            values.append(value.to_numpy()[slots])
            first += self._rows_of_chunk
        where = (np.repeat(np.arange(n), length), np.concatenate(columns))
        matrix = scipy.sparse.csr_matrix((np.concatenate(values), where), (n, n), dtype=float)
        return (matrix + scipy.sparse.diags(particles.numpy(self.diagonal))).tocsr()

    def assemble(
        self, laplacian: Laplacian, lattice: Lattice, particles: Particles, pairs: Pairs, *, over: int = ANY,
        equation: Equation = PRESSURE, arguments: tuple[float, ...] = (),
    ) -> None:  # fmt: skip
        """Fill matrix and right side from the states and the fields that the equation reads.

        Args:
            over: kinds of the rows that take part (those that are not ABSENT).
            arguments: numbers for the equation's ``diagonal`` and ``right``.
        """
        self._place(particles, pairs)
        self.symmetric = laplacian.symmetric
        laplacian.prepare(lattice, particles, pairs, over)
        terms = laplacian.terms()
        near = tuple(dict.fromkeys((*equation.pair_reads, *terms.reads)))
        own = tuple(n for n in dict.fromkeys((*equation.row_reads, *terms.row_reads)) if n not in near)
        signature = tuple(
            (n, particles.fields[n].value_shape(particles.dimension), particles.fields[n].dtype is int)
            for n in (*near, *own)
        )
        kernel = _assembly_kernel(
            terms, equation, signature, near, own, shared(near, particles, {}), laplacian.weight.function(),
            particles.dimension, pairs.periodic, len(arguments), self.real,
        )  # fmt: skip
        for chunk, column, value in zip(pairs.list.chunks, self.columns, self.values, strict=True):
            kernel(
                particles["position"], particles[self.state], particles[self.diagonal], particles[self.rhs],
                particles[self.length], particles[self.grounded],
                self.start, pairs.list.start, pairs.list.length, chunk.neighbour, column, value,
                *[particles[n] for n in (*near, *own)],
                chunk.begin, chunk.end, _stretches(chunk.end - chunk.begin), laplacian.radius(lattice),
                laplacian.scale(lattice), *arguments, *pairs.list.period,
            )  # fmt: skip

    def _place(self, particles: Particles, pairs: Pairs) -> None:
        """Make room: every row with an equation gets as many slots as it has neighbours, and no other row any."""
        blocks = -(-particles.capacity // _ROWS_PER_BLOCK)
        if self.start is None or self.start.shape[0] != particles.capacity:
            self.start = kernels.array(kernels.i32, particles.capacity)
            self._sums = kernels.array(kernels.i64, blocks + 1)
        chunks = pairs.list.chunks
        self._rows_of_chunk = chunks[0].end - chunks[0].begin
        wide = kernels.runtime().wide
        del self.columns[len(chunks) :], self.values[len(chunks) :]
        for number, chunk in enumerate(chunks):
            rows = chunk.end - chunk.begin
            if wide:
                needed = chunk.neighbour.shape[0]
            else:
                _placing_kernel(kernels.light(rows))(
                    particles[self.state], pairs.list.length, self.start, self._sums, chunk.begin, chunk.end
                )
                needed = int(kernels.host(self._sums)[-(-rows // _ROWS_PER_BLOCK)])
            if number < len(self.columns) and needed <= self.columns[number].shape[0]:
                continue
            # Let go of the old ones first: at ten million rows there is no room for both.
            del self.columns[number : number + 1], self.values[number : number + 1]
            slots = needed if wide else min(int(_MORE_SLOTS * needed) + 64, kernels.LONGEST_ARRAY)
            self.columns.insert(number, kernels.array(kernels.i32, slots))
            self.values.insert(number, kernels.array(self.real, slots))

    def bytes(self) -> int:
        """Return the memory of the entries and their places [bytes]."""
        places = 0 if self.start is None else 4 * self.start.shape[0] + 8 * self._sums.shape[0]
        slots = sum(column.shape[0] for column in self.columns)
        return places + slots * (4 + (4 if self._single else kernels.runtime().dtype().itemsize))


def _stretches(rows: int) -> int:
    """Return into how many stretches of rows the assembly is split."""
    runtime = kernels.runtime()
    if runtime.device != "cpu":
        return max(rows, 1)
    return 1 if runtime.serial else 16 * runtime.threads


_ROWS_PER_BLOCK = 64

_BUFFERED = 64
"""Coefficients of a row that are computed before any is stored."""

_MORE_SLOTS = 1.1
"""Slots that are made when there are too few, as a multiple of those that are needed."""


@kernels.cached
def _placing_kernel(serial: bool) -> Any:
    """Generate the exclusive sums of the rows' neighbours, over rows with an equation."""
    Rows, Sums = kernels.array_type(kernels.i32), kernels.array_type(kernels.i64)
    qd, size = kernels.qd, _ROWS_PER_BLOCK

    @kernels.kernel
    def place(state: Rows, length: Rows, start: Rows, sums: Sums, begin: kernels.i32, end: kernels.i32):
        qd.loop_config(serialize=serial)
        for b in range((end - begin + size - 1) // size):
            total = 0
            for i in range(begin + b * size, qd.min(begin + (b + 1) * size, end)):
                total += qd.select(state[i] == UNKNOWN, length[i], 0)
            sums[b] = qd.cast(total, qd.i64)
        qd.loop_config(serialize=True)
        for _ in range(1):
            before = qd.cast(0, qd.i64)
            for b in range((end - begin + size - 1) // size):
                own = sums[b]
                sums[b] = before
                before += own
            sums[(end - begin + size - 1) // size] = before
        qd.loop_config(serialize=serial)
        for b in range((end - begin + size - 1) // size):
            slot = sums[b]
            for i in range(begin + b * size, qd.min(begin + (b + 1) * size, end)):
                start[i] = qd.cast(slot, qd.i32)
                slot += qd.cast(qd.select(state[i] == UNKNOWN, length[i], 0), qd.i64)

    return place


@kernels.cached
def _assembly_kernel(
    terms: Terms, equation: Equation, signature: Signature, near: tuple[str, ...], own: tuple[str, ...],
    common: tuple[str, ...], weight: Any, d: int, periodic: tuple[bool, ...], n_arguments: int, value: Any,
) -> Any:  # fmt: skip
    """Generate the assembly for one Laplacian model and one equation."""
    Own, loading_own = load(signature, (*near, *own))
    Near, loading_near = load(signature, near, common)
    types = {n: kernels.value_type(shape, integer) for n, shape, integer in signature}
    real, spread = kernels.runtime().real, kernels.spread(_stretches(1))
    scope: dict[str, Any] = {
        "Own": Own, "Near": Near, "coefficient": terms.coefficient, "weight": weight, "real": real,
        "serial": kernels.runtime().serial, "Vector": kernels.vector(d),
        "Vectors": kernels.array_type(kernels.vector(d)),
        "Starts": kernels.array_type(kernels.i64), "Rows": kernels.array_type(kernels.i32),
        "Reals": kernels.array_type(real), "Values": kernels.array_type(value), "entry": value,
        "Buffer": kernels.qd.types.vector(_BUFFERED, value),
        "missing": terms.diagonal, "leaning": terms.rhs, **vars(equation),
    }  # fmt: skip
    parameters = [
        "position: Vectors", "state: Rows", "out_diagonal: Reals", "out_rhs: Reals", "out_length: Rows",
        "out_grounded: Rows", "out_start: Rows", "start: Starts", "length: Rows", "neighbour: Rows",
        "column: Rows", "value: Values",
    ]  # fmt: skip
    for n in (*near, *own):
        scope[f"In_{n}"] = kernels.array_type(types[n])
        parameters.append(f"in_{n}: In_{n}")
    arguments = [f"argument{k}" for k in range(n_arguments)]
    parameters += ["begin: qd.i32", "end: qd.i32", "parts: qd.i32", "re: real", "scale: real"]
    parameters += [f"{n}: real" for n in (*arguments, *[f"period{k}" for k in range(d)])]
    of_equation = "".join(f", {n}" for n in arguments)
    missing = terms.diagonal is not None and equation.outside is not None
    leaning = terms.rhs is not None
    factor = "pair(a, b)" if equation.image is None else f"qd.select(state[j] == {FLUX}, image(a), pair(a, b))"
    near_row = f"b = {loading_near.replace('Row(', 'Near(').format(row='j')}"
    nearest = minimum_image(periodic)
    # What leans on a gradient is a sum of coefficients without the factor of their pair: that gradient is the one of
    # the row's own fluid, also where the neighbour is of another.
    lean = "c * r" if set(equation.pair_of) <= set(common) else "c * row(a) / factor * r"
    coefficients = [
        "r = position[j] - x",
        *nearest,
        "rr = r.dot(r)",
        near_row,
        f"factor = {factor}",
        "c = scale * coefficient(a, b, r, weight(qd.sqrt(rr), re)) * factor",
        f"c = qd.select((rr < re * re) & (state[j] != {ABSENT}), c, 0)",
        *(["c = qd.cast(qd.cast(c, entry), real)"] if value != real else []),
        *([f"lean += {lean}"] if leaning else []),
        f"total += qd.select(state[j] == {FLUX}, 0, c)",
    ]
    known_values = [
        f"    if state[j] == {KNOWN}:",
        "        summed += c * known(b)",
        f"        tied = {WHOLLY_TIED}",
        "    else:",
        "        summed += c * flux(a, b, r)",
        *(["        total += c * flux_share(a, b, r)"] if equation.flux_share else []),
    ]
    stride = lanes.stride()
    if kernels.runtime().wide:
        beginning = [
            "    qd.loop_config(serialize=serial)",
            "    for t in range(begin, end):",
            "        cursor = qd.cast(start[t], qd.i32)",
            "        for i in range(t, t + 1):",
        ]
        walk = [
            "for k in range(length[i]):",
            f"    j = neighbour[cursor + k * {stride}] & {ROW_BITS}",
            *[f"    {line}" for line in coefficients],
            f"    if (c != 0) & (state[j] == {UNKNOWN}):",
            f"        column[cursor + used * {stride}] = j",
            f"        value[cursor + used * {stride}] = -qd.cast(c, entry)",
            "        used += 1",
            "    elif c != 0:",
            *[f"    {line}" for line in known_values],
        ]
    else:
        beginning = [
            "    qd.loop_config(serialize=serial, block_dim=1)",
            f"    for t in range(parts * {spread}):",
            f"        part = t // {spread}",
            "        rows = qd.cast(end - begin, qd.i64)",
            "        first_row = begin + qd.cast(rows * part // parts, qd.i32)",
            f"        beyond = qd.select(t % {spread} == 0, begin + qd.cast(rows * (part + 1) // parts, qd.i32), 0)",
            "        cursor = out_start[first_row]",
            "        buffer = Buffer(0.0)",
            "        for i in range(first_row, beyond):",
        ]
        # The coefficients first, without branches and stores between them: that loop becomes vector instructions.
        walk = [
            f"for block in range((length[i] + {_BUFFERED - 1}) // {_BUFFERED}):",
            f"    slot = qd.cast(start[i], qd.i32) + block * {_BUFFERED}",
            f"    here = qd.min(length[i] - block * {_BUFFERED}, {_BUFFERED})",
            "    for k in range(here):",
            f"        j = neighbour[slot + k] & {ROW_BITS}",
            *[f"        {line}" for line in coefficients],
            "        buffer[k] = qd.cast(c, entry)",
            "    for k in range(here):",
            f"        j = neighbour[slot + k] & {ROW_BITS}",
            "        if buffer[k] != 0:",
            f"            if state[j] == {UNKNOWN}:",
            "                column[cursor + used] = j",
            "                value[cursor + used] = -buffer[k]",
            "                used += 1",
            "            else:",
            f"                {near_row}",
            "                r = position[j] - x",
            *[f"                {line}" for line in nearest],
            "                c = qd.cast(buffer[k], real)",
            *[f"            {line}" for line in known_values],
        ]
    lines = [
        f"def assemble({', '.join(parameters)}):",
        *beginning,
        "            used = 0",
        "            tied = 0",
        "            total = qd.cast(1, real)",
        "            summed = qd.cast(0, real)",
        f"            if state[i] == {UNKNOWN}:",
        f"                a = {loading_own.replace('Row(', 'Own(').format(row='i')}",
        "                x = position[i]",
        f"                total = diagonal(a{of_equation})",
        f"                summed = right(a{of_equation})",
        *(
            [
                "                absent = scale * row(a) * missing(a)",
                "                total += absent",
                "                summed += absent * outside(a)",
            ]
            if missing
            else []
        ),
        *(["                lean = Vector(0.0)"] if leaning else []),
        "                own = total",
        *[f"                {line}" for line in walk],
        *(["                summed += leaning(a, lean)"] if leaning else []),
        "                if own > 0:",
        f"                    share = qd.select(total > own, {WHOLLY_TIED} * own / total, {WHOLLY_TIED})",
        "                    tied = qd.max(tied, qd.cast(share, qd.i32), 1)",
        # A row that is tied to nothing has the value zero: its equation would be 0 x = right.
        "                if total == 0.0:",
        "                    total = qd.cast(1, real)",
        "                    summed = qd.cast(0, real)",
        "            out_diagonal[i] = total",
        "            out_rhs[i] = summed",
        "            out_length[i] = used",
        "            out_start[i] = cursor",
        "            cursor += used",
        "            out_grounded[i] = tied",
    ]
    return kernels.compiled("assemble", "\n".join(lines) + "\n", **scope)
