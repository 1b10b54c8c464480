"""The particle table: every row that touches the water, one array per field."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spume import kernels, reductions

FLUID = 1
WALL = 2
DUMMY = 4
SOLID = WALL | DUMMY
ANY = FLUID | SOLID


@dataclass(frozen=True)
class Field:
    """A quantity that every row carries.

    Attributes:
        name: the field's name, as in ``docs/notation.md``.
        shape: () for a scalar, ("d",) for a vector, ("d", "d") for a tensor, or integers; "basis" stands for the
            d (d + 3)/2 monomials of first and second degree, "symmetric" for the d (d + 1)/2 components of a
            symmetric tensor.
        unit: SI unit.
        doc: one sentence.
        dtype: float or int.
        initial: value of a row that is inserted without one.
        constant: never written by a step.
        output: written to result files by default.
        restart: the next step reads it, so it is carried through sorting and saved by checkpoints.
        scratch: name of the only function that it means anything in, if there is one: what other functions keep for
            themselves may then lie in the same memory.
    """

    name: str
    shape: tuple[int | str, ...] = ()
    unit: str = "1"
    doc: str = ""
    dtype: type = float
    initial: float = 0.0
    constant: bool = False
    output: bool = False
    restart: bool = False
    scratch: str = ""

    def value_shape(self, d: int) -> tuple[int, ...]:
        """Return the shape of one row's value in d dimensions."""
        lengths = {"d": d, "basis": d * (d + 3) // 2, "symmetric": d * (d + 1) // 2}
        return tuple(lengths[s] if isinstance(s, str) else s for s in self.shape)


Signature = tuple[tuple[str, tuple[int, ...], bool], ...]
"""Names, shapes of a value, and whether it is an integer."""


_BRINGING_BACK = 0.6
"""Part of the rows up to which it is cheaper to bring the moved ones back than to move all."""

BASE_FIELDS = (
    Field("position", ("d",), "m", "position of the particle's centre", output=True, restart=True),
    Field("velocity", ("d",), "m/s", "velocity", output=True, restart=True),
    Field("acceleration", ("d",), "m/s^2", "sum of all accelerations except the pressure's"),
    Field("pressure", (), "Pa", "pressure", output=True, restart=True),
    Field("pressure_gradient", ("d",), "Pa/m", "gradient of the pressure", restart=True),
    Field("number_density", (), "1", "particle number density n", output=True),
    Field("density", (), "kg/m^3", "density of the row's material", constant=True, restart=True),
    Field("kinematic_viscosity", (), "m^2/s", "kinematic viscosity of the row's material", constant=True, restart=True),
    Field("kind", (), "1", "1 fluid, 2 wall, 4 dummy", int, output=True, constant=True, restart=True),
    Field("body", (), "1", "index of the row's body, -1 for fluid", int, -1, output=True, constant=True, restart=True),
    Field("material", (), "1", "index of the row's fluid", int, constant=True, restart=True),
    Field("id", (), "1", "stable number of the particle", int, output=True, constant=True, restart=True),
    Field("free_surface", (), "1", "1 on the free surface", int, output=True, restart=True),
    Field("to_surface", ("d",), "m", "solid rows: vector to the nearest point of the wetted surface", restart=True),
    Field("dry", (), "1", "1 for solid rows that no fluid is near: they take no part", int, restart=True),
    Field(
        "exposed", (), "1", "solid rows: faces of the cell beyond which the body has no row, 4^k and 2 4^k of axis k",
        int, constant=True, restart=True,
    ),
    Field("master", (), "1", "dummy rows: id of the wall row that they copy", int, constant=True, restart=True),
)  # fmt: skip


class Particles:
    """The table of rows: fluid of every phase, walls and dummies.

    Row order changes whenever the neighbour search sorts the rows by cell; ``id`` is stable.

    Args:
        dimension: 2 or 3.
        spacing: l0 [m].
        fields: fields beyond the base fields.
        capacity: rows to make room for; the table grows by doubling.

    Attributes:
        count: rows of the table.
        active: rows that take part in the steps; those behind them are solid and dry (see ``part``).
        changed: rows came or went since the neighbours were searched.
        traffic: bytes that loops over rows moved at least since the table was made: each value once.
        visits: how often loops walked the lists of neighbours of the active rows.
        bodies: labels of the bodies, in the order of the field ``body``.
    """

    def __init__(
        self,
        dimension: int,
        spacing: float,
        fields: Iterable[Field] = (),
        capacity: int = 1024,
        bodies: Sequence[str] = (),
    ) -> None:
        self.dimension = dimension
        self.spacing = spacing
        self.bodies = tuple(bodies)
        self.count = 0
        self.capacity = max(int(capacity), 1)
        self.active = 0
        self.traffic = 0
        self.visits = 0
        self.changed = True
        self._parted = False
        self.fields: dict[str, Field] = {}
        self._arrays: dict[str, Any] = {}
        self._sharing: dict[tuple[Any, ...], list[str]] = {}
        self._beside: dict[str, tuple[str, ...]] = {}
        self._spares: dict[Any, Any] = {}
        self._next_id = 0
        self._row_of_id: Any = None
        self._row_of_id_valid = False
        self._partial: Any = None
        self._reduced: Any = None
        self._writes: dict[str, int] = {}
        self._signatures: dict[tuple[tuple[str, str], ...], Signature] = {}
        self._row_bytes: dict[tuple[str, ...], int] = {}
        self._uniform: dict[str, bool] = {}
        self._origin: dict[str, tuple[Any, ...]] = {}
        self.declare(BASE_FIELDS)
        self.declare(fields)

    def declare(self, fields: Iterable[Field]) -> None:
        """Add fields to the table; a field that is there already must be the same.

        Raises:
            ValueError: two different fields of one name.
        """
        for field in fields:
            known = self.fields.get(field.name)
            if known is None:
                self.fields[field.name] = field
                names = self._same_memory(field)
                names.append(field.name)
                self._beside |= dict.fromkeys(names, tuple(names))
                if len(names) > 1:
                    self._arrays[field.name] = self._arrays[names[0]]
                    continue
                self._arrays[field.name] = kernels.array(self._type(field), self.capacity)
                if self.count:
                    self.set(field.name, np.full((self.count, *field.value_shape(self.dimension)), field.initial))
            elif known != field:
                raise ValueError(f"field {field.name!r} is declared twice, differently: {known} and {field}")

    def _same_memory(self, field: Field) -> list[str]:
        """Return the names of the fields that lie in the memory of a field."""
        if not field.scratch:
            return self._sharing.setdefault((field.name,), [])
        mine = (field.value_shape(self.dimension), field.dtype is int)
        place = sum(
            f.scratch == field.scratch and (f.value_shape(self.dimension), f.dtype is int) == mine
            for f in self.fields.values()
            if f is not field
        )
        return self._sharing.setdefault((*mine, place), [])

    def __getitem__(self, name: str) -> Any:
        return self._arrays[name]

    def row_bytes(self, names: Iterable[str]) -> int:
        """Return the memory of some fields of one row [bytes]."""
        asked = tuple(names)
        found = self._row_bytes.get(asked)
        if found is None:
            real = kernels.runtime().dtype().itemsize
            found = self._row_bytes[asked] = sum(
                (4 if self.fields[n].dtype is int else real) * prod(self.fields[n].value_shape(self.dimension))
                for n in asked
            )
        return found

    def signature(self, names: Iterable[str], behind: Mapping[str, str]) -> Signature:
        """Return name, shape of a value and whether it is an integer, for names behind which fields stand."""
        asked = tuple((n, behind.get(n, n)) for n in names)
        found = self._signatures.get(asked)
        if found is None:
            fields = {n: self.fields[field] for n, field in asked}
            found = self._signatures[asked] = tuple(
                (n, field.value_shape(self.dimension), field.dtype is int) for n, field in fields.items()
            )
        return found

    def uniform(self, name: str) -> bool:
        """Return whether every row has the same number in a field that no step writes: one fluid's density, say."""
        found = self._uniform.get(name)
        if found is None:
            field = self.fields[name]
            found = field.constant and field.shape == ()
            if found:
                values = kernels.host(self._arrays[name])[: self.count]
                found = self.count > 0 and bool(values.min() == values.max())
            self._uniform[name] = found
        return found

    def bytes(self) -> int:
        """Return the memory of all fields, and of what sorting needs [bytes]."""
        rows = sum(self.row_bytes([names[0]]) for names in self._sharing.values())
        real = kernels.runtime().dtype().itemsize
        rows += sum((4 if integer else real) * prod(shape) for shape, integer in self._spares)
        return self.capacity * rows

    def written(self, *names: str) -> None:
        """Note that fields were written, as pair sums, row maps and the search do; without names all fields."""
        for name in names or self.fields:
            for other in self._beside.get(name, (name,)):
                self._writes[other] = self._writes.get(other, 0) + 1
                self._origin.pop(other, None)

    def keep(self, name: str, recipe: tuple[Any, ...], made_of: tuple[str, ...]) -> None:
        """Note how a field was just made, so that ``keeps`` can say whether making it again would change it."""
        self._origin[name] = (recipe, *(self._writes.get(n, 0) for n in made_of))

    def keeps(self, name: str, recipe: tuple[Any, ...], made_of: tuple[str, ...]) -> bool:
        """Return whether a field still holds what ``recipe`` made of fields that nobody has written since."""
        return self._origin.get(name) == (recipe, *(self._writes.get(n, 0) for n in made_of))

    def value_type(self, name: str) -> Any:
        """Return the kernel language's type of one value of a field."""
        return self._type(self.fields[name])

    def _type(self, field: Field) -> Any:
        return kernels.value_type(field.value_shape(self.dimension), field.dtype is int)

    def numpy(self, name: str) -> NDArray[Any]:
        """Return a copy of a field, shape (count, *shape), in the present order of rows."""
        return np.array(kernels.host(self._arrays[name])[: self.count])

    def set(self, name: str, values: ArrayLike) -> None:
        """Overwrite a field with values of shape (count, *shape) in the present order of rows."""
        array = self._arrays[name]
        full = kernels.host(array)
        full[: self.count] = values
        kernels.publish(array, full)
        self.changed |= name == "kind"  # lists hold fluid neighbours first
        self._uniform.pop(name, None)
        self.written(name)

    def insert(self, rows: Mapping[str, ArrayLike]) -> None:
        """Append rows; fields that are not given take their ``initial`` value, ids are numbered on.

        Args:
            rows: field name to values of shape (m, *shape); ``position`` is needed.

        Raises:
            KeyError: a name that is no field.
            ValueError: values of another length or shape.
        """
        unknown = set(rows) - set(self.fields)
        if unknown:
            raise KeyError(f"no such field: {', '.join(sorted(unknown))}")
        new = len(np.asarray(rows["position"]))
        if new == 0:
            return
        self._grow(self.count + new)
        untouched = self._next_id == 0  # arrays are made of zeros
        for name, field in self.fields.items():
            shape = (new, *field.value_shape(self.dimension))
            if untouched and name not in rows and name != "id" and field.initial == 0:
                continue
            if name in rows:
                values = np.asarray(rows[name])
                if values.shape != shape:
                    raise ValueError(f"rows of {name!r}: shape {values.shape}, expected {shape}")
            elif name == "id":
                values = np.arange(self._next_id, self._next_id + new)
            else:
                values = np.full(shape, field.initial)
            full = kernels.host(self._arrays[name])
            full[self.count : self.count + new] = values
            kernels.publish(self._arrays[name], full)
        self.count += new
        self.active = self.count
        self._row_of_id_valid = False
        self._next_id = max(self._next_id + new, int(self.numpy("id").max()) + 1)
        self._uniform.clear()
        self.changed = True
        self.written()

    def remove(self, rows: NDArray[np.bool_]) -> int:
        """Remove the rows where the mask of shape (count,) is true; return how many went."""
        gone = int(np.count_nonzero(rows))
        if gone == 0:
            return 0
        for name in self.fields:
            full = kernels.host(self._arrays[name])
            full[: self.count - gone] = full[: self.count][~rows]
            kernels.publish(self._arrays[name], full)
        self.count -= gone
        self.active = self.count
        self._row_of_id_valid = False
        self.changed = True
        self.written()
        return gone

    def replace(self, values: Mapping[str, NDArray[Any]], next_id: int) -> None:
        """Make these the rows of the table, in this order; fields that are not given keep what they hold.

        Args:
            values: field name to values of shape (count, *shape), ``position`` among them, as `numpy` gave them.
            next_id: number of the next row that is inserted.
        """
        self.count = len(values["position"])
        self._grow(self.count)
        for name, rows in values.items():
            self.set(name, rows)
        self._next_id = next_id
        self.active = self.count
        self._row_of_id_valid = False
        self.changed = True
        self.written()

    @property
    def next_id(self) -> int:
        """Number of the next row that is inserted without one."""
        return self._next_id

    def reorder(self, order: Any, last: int | None = None) -> None:
        """Gather every restart field whose rows differ by ``order`` (device array of row numbers, int32).

        Args:
            order: which row comes to each place.
            last: number of the rows from the first on that may change places; default: all.
        """
        last = self.count if last is None else last
        # Dry rows at the end stay where they are: the others are brought back, so that those need not be moved.
        back = last < _BRINGING_BACK * self.count
        count = last if back else self.count
        for group in self._moving_together():
            for kind, name in group.items():
                if kind not in self._spares:
                    self._spares[kind] = kernels.array(self._type(self.fields[name]), self.capacity)
            pairs = [(self._arrays[name], self._spares[kind]) for kind, name in group.items()]
            kernel = _gather_kernel(tuple(group), kernels.light(count), back)
            kernel(order, *[array for pair in pairs for array in pair], count)
            if not back:
                for (kind, name), (source, spare) in zip(group.items(), pairs, strict=True):
                    self._arrays[name], self._spares[kind] = spare, source
            self.traffic += count * (4 + (4 if back else 2) * self.row_bytes(group.values()))
        self._row_of_id_valid = False
        self.written()

    def _moving_together(self) -> list[dict[Any, str]]:
        """Return the fields that sorting moves by the kind of their values, one field of a kind in each group."""
        groups: list[dict[Any, str]] = []
        for name, field in self.fields.items():
            if field.restart and not self.uniform(name):
                kind = (field.value_shape(self.dimension), field.dtype is int)
                free = next((group for group in groups if kind not in group), None)
                if free is None:
                    groups.append({kind: name})
                else:
                    free[kind] = name
        return groups

    def part(self, active: int) -> None:
        """Let only the first ``active`` rows take part in the steps; the rows behind are solid and dry.

        A row that has become dry, or wet again, loses its pressure and all that a step computes for it.
        """
        self.active = active
        if active == self.count and not self._parted:
            return
        self._parted = active < self.count
        lost = [n for n, f in self.fields.items() if not f.restart or n in ("pressure", "pressure_gradient")]
        signature = tuple((n, self.fields[n].value_shape(self.dimension), self.fields[n].dtype is int) for n in lost)
        initial = tuple(float(self.fields[n].initial) for n in lost)
        _part_kernel(signature, initial)(self["dry"], *[self[n] for n in lost], active, self.count)
        self.written(*lost)

    def rows_by_id(self) -> Any:
        """Return a device array that holds the present row number of each id."""
        if self._row_of_id is None or self._row_of_id.shape[0] < self._next_id:
            self._row_of_id = kernels.array(kernels.i32, 2 * self._next_id)
            self._row_of_id_valid = False
        if not self._row_of_id_valid:
            _invert_kernel(kernels.light(self.count))(self["id"], self._row_of_id, self.count)
            self._row_of_id_valid = True
        return self._row_of_id

    def largest_norm(self, name: str, rows: int = ANY) -> float:
        """Return the largest length of a vector field over active rows of some kinds, NaN if one is not a number."""
        reductions.largest_kernel(self.fields[name].value_shape(self.dimension)[0], kernels.light(self.active))(
            self[name], self["kind"], *self._reduction(), rows, self.active
        )
        largest = np.max(kernels.host(self._reduced))
        return float(np.sqrt(largest)) if largest < np.finfo(largest.dtype).max else float("nan")

    def total(self, name: str, rows: int = ANY) -> float:
        """Return the sum of a scalar field over active rows of some kinds; its order does not depend on threads."""
        reductions.total_kernel(self.fields[name].dtype is int, kernels.light(self.active))(
            self[name], self["kind"], *self._reduction(), rows, self.active
        )
        return float(np.sum(kernels.host(self._reduced)))

    def smallest(self, name: str, rows: int = ANY) -> float:
        """Return the smallest value of a scalar field over active rows of the given kinds, 0 if there are none."""
        return self._extreme(name, rows, False)

    def largest(self, name: str, rows: int = ANY) -> float:
        """Return the largest value of a scalar field over active rows of the given kinds, 0 if there are none."""
        return self._extreme(name, rows, True)

    def _reduction(self) -> tuple[Any, Any]:
        """Return the arrays of partial sums or extremes, and of what is left of them for the processor."""
        if self._partial is None:
            self._partial, self._reduced = reductions.reduction_arrays(kernels.runtime().real)
        return self._partial, self._reduced

    def _extreme(self, name: str, rows: int, largest: bool) -> float:
        reductions.extreme_kernel(largest, kernels.light(self.active))(
            self[name], self["kind"], *self._reduction(), rows, self.active
        )  # fmt: skip
        found = kernels.host(self._reduced)
        value = float(found.max() if largest else found.min())
        return value if abs(value) < np.finfo(kernels.runtime().dtype).max else 0.0

    def _grow(self, needed: int) -> None:
        if needed <= self.capacity:
            return
        while self.capacity < needed:
            self.capacity *= 2
        self._spares.clear()
        for names in self._sharing.values():
            array = kernels.array(self.value_type(names[0]), self.capacity)
            full = kernels.host(array)
            full[: self.count] = kernels.host(self._arrays[names[0]])[: self.count]
            kernels.publish(array, full)
            self._arrays |= dict.fromkeys(names, array)


@kernels.cached
def _part_kernel(signature: tuple[tuple[str, tuple[int, ...], bool], ...], initial: tuple[float, ...]) -> Any:
    """Generate the loops that reset rows which have become wet or dry."""
    scope: dict[str, Any] = {"Rows": kernels.array_type(kernels.i32)}
    parameters, resets = ["dry: Rows"], []
    for (name, shape, integer), value in zip(signature, initial, strict=True):
        kind = kernels.value_type(shape, integer)
        scope[f"In_{name}"], scope[f"Value_{name}"] = kernels.array_type(kind), kind
        parameters.append(f"in_{name}: In_{name}")
        number = repr(int(value) if integer else value)
        resets.append(f"in_{name}[i] = {number if shape == () else f'Value_{name}({number})'}")
    one_thread = not kernels.runtime().wide
    lines = [
        f"def part({', '.join(parameters)}, active: qd.i32, count: qd.i32):",
        f"    qd.loop_config(serialize={one_thread})",
        "    for i in range(active):",
        "        if dry[i] != 0:",
        "            dry[i] = 0",
        *[f"            {line}" for line in resets],
        f"    qd.loop_config(serialize={one_thread})",
        "    for i in range(active, count):",
        "        if dry[i] == 0:",
        "            dry[i] = 1",
        *[f"            {line}" for line in resets],
    ]
    return kernels.compiled("part", "\n".join(lines) + "\n", **scope)


@kernels.cached
def _gather_kernel(kinds: tuple[tuple[tuple[int, ...], bool], ...], serial: bool, back: bool) -> Any:
    """Generate the gathering of a field of each kind by one order, and the copy ``back`` of what was gathered."""
    scope: dict[str, Any] = {"Rows": kernels.array_type(kernels.i32), "serial": serial}
    scope |= {f"Values{k}": kernels.array_type(kernels.value_type(*kind)) for k, kind in enumerate(kinds)}
    numbers = range(len(kinds))
    parameters = ["order: Rows", *[f"source{k}: Values{k}, target{k}: Values{k}" for k in numbers], "count: qd.i32"]
    lines = [f"def gather({', '.join(parameters)}):", "    qd.loop_config(serialize=serial)"]
    lines += ["    for i in range(count):", "        j = order[i]"]
    lines += [f"        target{k}[i] = source{k}[j]" for k in numbers]
    if back:
        lines += ["    qd.loop_config(serialize=serial)", "    for i in range(count):"]
        lines += [f"        source{k}[i] = target{k}[i]" for k in numbers]
    return kernels.compiled("gather", "\n".join(lines) + "\n", **scope)


@kernels.cached
def _invert_kernel(serial: bool) -> Any:
    Rows = kernels.array_type(kernels.i32)
    qd = kernels.qd

    @kernels.kernel
    def invert(ids: Rows, row_of_id: Rows, count: kernels.i32):
        qd.loop_config(serialize=serial)
        for i in range(count):
            row_of_id[ids[i]] = i

    return invert
