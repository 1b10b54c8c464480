"""Linear system of the pressure Poisson equation, assembled from a Laplacian model.

Every row of the table has a state:

* UNKNOWN: its value is solved for;
* KNOWN: its value is given (free surface);
* FLUX: a solid row without an equation; towards its neighbours it imposes a known difference,
  P_j - P_i = wall_gradient_j . r_ij (Neumann condition), which goes to the right side;
* ABSENT: it takes no part.

With c_ij the coefficient of the Laplacian and rho_ij the mean density of the pair, row i states
sum_j c_ij/rho_ij (P_i - P_j) + surface_diagonal_i P_i = -source_i.
"""

from typing import Any

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, load, minimum_image
from spume.particles import Field, Particles
from spume.schemes.laplacian.base import Laplacian

ABSENT, UNKNOWN, KNOWN, FLUX = 0, 1, 2, 3

SYSTEM_FIELDS = (
    Field("row_state", (), "1", "0 absent, 1 unknown, 2 known, 3 known flux", int),
    Field("diagonal", (), "m/kg", "diagonal of the pressure matrix"),
    Field("rhs", (), "1/s^2", "right side of the pressure matrix"),
    Field("row_length", (), "1", "entries of a row beside the diagonal", int),
    Field("wall_gradient", ("d",), "Pa/m", "solid rows: rho (g - a_wall), the imposed pressure gradient"),
    Field("surface_diagonal", (), "m/kg", "addition to the diagonal by the free surface"),
    Field("surface_value", (), "Pa", "pressure to which the free surface draws a row"),
    Field("grounded", (), "1", "1 where a row is tied to a known pressure", int),
)


class LinearSystem:
    """A sparse matrix over the rows of the table, in the slots of the neighbour list.

    Attributes:
        column: row numbers of the entries.
        value: entries beside the diagonal.
        start: first slot of each row, shared with the neighbour list.
    """

    def __init__(self) -> None:
        self.column: Any = None
        self.value: Any = None
        self.start: Any = None
        self._slots = 0

    def assemble(self, laplacian: Laplacian, lattice: Lattice, particles: Particles, pairs: Pairs) -> None:
        """Fill the matrix and the right side from ``row_state``, ``source``, ``pressure`` of known rows."""
        slots = pairs.list.neighbour.shape[0]
        if slots != self._slots:
            self._slots = slots
            self.column = kernels.array(kernels.i32, slots)
            self.value = kernels.array(kernels.runtime().real, slots)
        self.start = pairs.list.start
        laplacian.prepare(lattice, particles, pairs)
        reads = tuple(dict.fromkeys(("density", *laplacian.reads)))
        signature = tuple(
            (n, particles.fields[n].value_shape(particles.dimension), particles.fields[n].dtype is int) for n in reads
        )
        kernel = _assembly_kernel(
            laplacian.coefficient, signature, laplacian.weight.function(), particles.dimension, pairs.periodic,
            laplacian.compensated,
        )  # fmt: skip
        kernel(
            particles["position"], particles["row_state"], particles["source"], particles["pressure"],
            particles["wall_gradient"], particles["surface_diagonal"], particles["surface_value"],
            particles["pressure_gradient"], particles["surface_share"],
            particles["diagonal"], particles["rhs"], particles["row_length"], particles["grounded"],
            pairs.list.start, pairs.list.length, pairs.list.neighbour, self.column, self.value,
            *[particles[n] for n in reads],
            particles.active, laplacian.radius(lattice), laplacian.scale(lattice), *pairs.list.period,
        )  # fmt: skip

    def bytes(self) -> int:
        """Return the memory of the entries [bytes]."""
        return self._slots * (4 + kernels.runtime().dtype().itemsize)


@kernels.cached
def _assembly_kernel(
    coefficient: Any, signature: Any, weight: Any, d: int, periodic: tuple[bool, ...], compensated: bool
) -> Any:
    """Generate the assembly for one Laplacian model."""
    reads = [n for n, _, _ in signature]
    Row, loading = load(signature, reads)
    real = kernels.runtime().real
    scope: dict[str, Any] = {
        "Row": Row, "coefficient": coefficient, "weight": weight, "real": real,
        "serial": kernels.runtime().serial, "Vectors": kernels.array_type(kernels.vector(d)),
        "Starts": kernels.array_type(kernels.i64), "Rows": kernels.array_type(kernels.i32),
        "Reals": kernels.array_type(real),
    }  # fmt: skip
    parameters = [
        "position: Vectors", "state: Rows", "source: Reals", "pressure: Reals", "wall_gradient: Vectors",
        "surface_diagonal: Reals", "surface_value: Reals", "pressure_gradient: Vectors", "surface_share: Reals",
        "diagonal: Reals", "rhs: Reals", "row_length: Rows", "grounded: Rows",
        "start: Starts", "length: Rows", "neighbour: Rows", "column: Rows", "value: Reals",
    ]  # fmt: skip
    for n, shape, integer in signature:
        scope[f"In_{n}"] = kernels.array_type(kernels.value_type(shape, integer))
        parameters.append(f"in_{n}: In_{n}")
    parameters += ["count: qd.i32", "re: real", "scale: real", *[f"period{k}: real" for k in range(d)]]
    lines = [
        f"def assemble({', '.join(parameters)}):",
        "    qd.loop_config(serialize=serial)",
        "    for i in range(count):",
        "        used = 0",
        "        tied = 0",
        "        total = qd.cast(1, real)",
        "        right = qd.cast(0, real)",
        f"        if state[i] == {UNKNOWN}:",
        f"            a = {loading.format(row='i')}",
        "            first = start[i]",
        "            x = position[i]",
        "            total = surface_diagonal[i]",
        "            right = -source[i] + surface_diagonal[i] * surface_value[i]",
        *(["            lean = x * 0.0"] if compensated else []),
        "            if surface_diagonal[i] > 0:",
        "                tied = 1",
        "            for k in range(length[i]):",
        "                j = neighbour[first + k]",
        "                r = position[j] - x",
        *[f"                {line}" for line in minimum_image(periodic)],
        "                rr = r.dot(r)",
        f"                if rr < re * re and state[j] != {ABSENT}:",
        f"                    b = {loading.format(row='j')}",
        "                    c = scale * coefficient(a, b, r, weight(qd.sqrt(rr), re))",
        "                    c *= 2.0 / (a.density + b.density)",
        *(["                    lean += c * r"] if compensated else []),
        f"                    if state[j] == {UNKNOWN}:",
        "                        column[first + used] = j",
        "                        value[first + used] = -c",
        "                        used += 1",
        "                        total += c",
        f"                    elif state[j] == {KNOWN}:",
        "                        total += c",
        "                        right += c * pressure[j]",
        "                        tied = 1",
        "                    else:",
        "                        right += c * wall_gradient[j].dot(r)",
        *(["            right -= (1.0 - surface_share[i]) * lean.dot(pressure_gradient[i])"] if compensated else []),
        "        diagonal[i] = total",
        "        rhs[i] = right",
        "        row_length[i] = used",
        "        grounded[i] = tied",
    ]
    return kernels.compiled("assemble", "\n".join(lines) + "\n", **scope)
