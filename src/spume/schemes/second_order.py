"""Derivatives of first and second order by least squares: the corrective matrix that gradient and Laplacian share.

With q the monomials of r_ij/l0 up to second degree (``basis``) and v_ij the weight of the fit, the derivatives
of phi at row i minimise sum_j v_ij (phi_j - phi_i - q_ij . D)^2:

    M_i = 1/n0 sum_j v_ij q_ij (x) q_ij,   D_i = M_i^-1 1/n0 sum_j v_ij (phi_j - phi_i) q_ij,
    grad phi = D[:d]/l0,   d2 phi/dx2 = 2 D[x^2]/l0^2,   d2 phi/dxdy = D[xy]/l0^2.

v = W l0^2/r^2 is the second-order corrective matrix (SCM, Duan et al. 2019; review Eqs. 18-20, 26), v = W is the
least-squares MPS (LSMPS type A, Tamai & Koshizuka 2014). What is stored of a row are not the matrix but the vectors
that turn a pair into its share of a derivative:

    lap phi  = 2/(n0 l0^2) sum_j v_ij (phi_j - phi_i) q_ij . laplacian_vector_i,
    grad phi = 1/(n0 l0)   sum_j v_ij (phi_j - phi_i) gradient_vectors_i q_ij.
"""

from typing import Any

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, minimum_image, row_map, row_term, slot
from spume.particles import ANY, FLUID, WALL, Field, Particles
from spume.schemes.operator import Operator

LAPLACIAN_VECTOR = Field("laplacian_vector", ("basis",), "1", "row of the second-order matrix for the Laplacian")
GRADIENT_VECTORS = Field("gradient_vectors", ("d", "basis"), "1", "rows of the second-order matrix for the gradient")
FIT_DEGREE = Field("fit_degree", (), "1", "degree of the polynomial that a row's neighbours determine: 0, 1, 2", int)

LEAST_PIVOT = 1e-3
"""Part of a monomial's square that the monomials before it may not explain, lest a row count as degenerate."""


@kernels.func
def basis(r, l0):  # type: ignore[no-untyped-def]
    """Return (x, y, x^2, y^2, xy) or (x, y, z, x^2, y^2, z^2, xy, yz, zx) of r/l0."""
    x = r[0] / l0
    y = r[1] / l0
    if kernels.static(r.n == 2):
        return kernels.qd.Vector([x, y, x * x, y * y, x * y])
    else:
        z = r[r.n - 1] / l0
        return kernels.qd.Vector([x, y, z, x * x, y * y, z * z, x * y, y * z, z * x])


@row_term(reads=("laplacian_vector",))
def scaled_vector(a, first, second):  # type: ignore[no-untyped-def]
    v = a.laplacian_vector
    d = kernels.static(2 if v.n == 5 else 3)
    for k in kernels.static(range(v.n)):
        v[k] *= first if kernels.static(k < d) else second
    return v


def per_metre(lattice: Lattice, particles: Particles, rows: int = FLUID | WALL) -> None:
    """Turn ``laplacian_vector`` into units of 1/m and 1/m^2, to be multiplied with ``basis(r, 1)``."""
    l0 = lattice.spacing
    row_map(scaled_vector, particles, out="laplacian_vector", rows=rows, arguments=(1.0 / l0, 1.0 / l0**2))


def second_order_vectors(
    operator: Operator,
    lattice: Lattice,
    particles: Particles,
    pairs: Pairs,
    *,
    inverse_square: bool,
    laplacian: bool = False,
    gradient: bool = False,
    over: int = ANY,
    rows: int = FLUID | WALL,
) -> None:
    """Write ``laplacian_vector`` and ``gradient_vectors`` as asked for, and ``fit_degree``, of every row of ``rows``.

    A row whose neighbours do not determine all second derivatives (``fit_degree`` < 2) takes the Laplacian of the
    original form, normalised by the regular arrangement, and the gradient of first order; one whose neighbours do not
    even determine that (``fit_degree`` 0) the uncorrected gradient.

    Args:
        inverse_square: v = W l0^2/r^2 (SCM); else v = W (LSMPS).
        laplacian, gradient: which vectors to write; their fields must be declared.
        over: kinds of the neighbours that take part.
    """
    d, l0 = lattice.dimension, lattice.spacing
    second = lattice.lambda_(operator.weight, operator.re) / l0**2
    fourth = lattice.fourth(operator.weight, operator.re) / l0**4
    # On the regular arrangement sum v q_x^2/n0 and sum v r^4/(l0^4 n0) are these; the fallbacks divide by them.
    first_moment = 1.0 / d if inverse_square else second / d
    fourth_moment = second if inverse_square else fourth
    outs = [n for n, wanted in (("laplacian_vector", laplacian), ("gradient_vectors", gradient)) if wanted]
    kernel, scratch = _kernel(
        operator.weight.function(), d, pairs.periodic, rows, over, inverse_square, laplacian, gradient
    )
    for chunk in pairs.list.chunks:
        kernel(
            particles["position"], particles["kind"], pairs.list.start, pairs.list.length, chunk.neighbour,
            particles["fit_degree"], *[particles[n] for n in outs], scratch, chunk.begin, chunk.end,
            operator.radius(lattice), float(l0), float(1.0 / operator.n0(lattice)), float(1.0 / first_moment),
            float(d / fourth_moment), *pairs.list.period,
        )  # fmt: skip


def _blocks() -> int:
    runtime = kernels.runtime()
    if runtime.serial:
        return 1
    return 64 * runtime.threads if not runtime.wide else 1 << 15


@kernels.cached
def _kernel(
    weight: Any, d: int, periodic: tuple[bool, ...], rows: int, over: int, inverse_square: bool,
    laplacian: bool, gradient: bool,
) -> tuple[Any, Any]:  # fmt: skip
    """Generate the loop over rows, and the work space in which each block of rows factorises M = L D L^T.

    The factorisation runs in loops over memory: unrolled, a 9 x 9 one takes minutes to compile.
    """
    runtime = kernels.runtime()
    real, parts, size = runtime.real, _blocks(), d * (d + 3) // 2
    spread = kernels.spread(parts)
    looping = "serialize=False" if runtime.wide else "block_dim=1" if parts > 1 else "serialize=True"
    triangle = size * (size + 1) // 2
    room = triangle + 2 * size
    outs = [("laplacian_vector", (size,))] * laplacian + [("gradient_vectors", (d, size))] * gradient
    scope: dict[str, Any] = {
        "weight": weight, "real": real, "basis": basis, "Moments": kernels.value_type((triangle,)),
        "Vectors": kernels.array_type(kernels.vector(d)), "Starts": kernels.array_type(kernels.i64),
        "Rows": kernels.array_type(kernels.i32), "Reals": kernels.array_type(real),
        "factorise": _factorise(size), "solve": _solve(size),
    }  # fmt: skip
    parameters = ["position: Vectors", "kind: Rows", "start: Starts", "length: Rows", "neighbour: Rows", "degree: Rows"]
    for name, shape in outs:
        scope[f"Out_{name}"] = kernels.array_type(kernels.value_type(shape))
        parameters.append(f"{name}: Out_{name}")
    parameters += ["work: Reals", "begin: qd.i32", "end: qd.i32"]
    parameters += [f"{n}: real" for n in ("re", "l0", "scale", "first", "second")]
    parameters += [f"period{k}: real" for k in range(d)]
    lines = [
        f"def second_order({', '.join(parameters)}):",
        f"    qd.loop_config({looping})",
        f"    for t in range({parts} * {spread}):",
        f"        b = t // {spread}",
        f"        at = b * {room}",
        f"        right = at + {triangle}",
        "        rows = qd.cast(end - begin, qd.i64)",
        f"        for i in range(begin + qd.cast(rows * b // {parts}, qd.i32),"
        f" qd.select(t % {spread} == 0, begin + qd.cast(rows * (b + 1) // {parts}, qd.i32), 0)):",
        f"            if kind[i] & {rows} != 0:",
        "                m = Moments(0.0)",
        "                x = position[i]",
        "                from_slot = start[i]",
        "                for k in range(length[i]):",
        f"                    j = neighbour[{slot('from_slot', 'k')}]",
        f"                    if {f'kind[j] & {over} != 0' if over != ANY else 'True'}:",
        "                        r = position[j] - x",
        *[f"                        {line}" for line in minimum_image(periodic)],
        "                        rr = r.dot(r)",
        "                        if rr < re * re:",
        "                            v = weight(qd.sqrt(rr), re) * scale"
        + (" * l0 * l0 / rr" if inverse_square else ""),
        "                            q = basis(r, l0)",
    ]
    for s in range(size):
        lines += [f"                            m[{s * (s + 1) // 2 + t}] += v * q[{s}] * q[{t}]" for t in range(s + 1)]
    pad = " " * 16
    lines += [f"{pad}work[at + {k}] = m[{k}]" for k in range(triangle)]
    lines += [f"{pad}good = factorise(work, at)", f"{pad}fitted = 0"]
    lines += [f"{pad}if good >= {d}:", f"{pad}    fitted = 1", f"{pad}if good == {size}:", f"{pad}    fitted = 2"]
    lines += [f"{pad}degree[i] = fitted"]
    if laplacian:
        for k in range(size):
            square = d <= k < 2 * d
            lines.append(f"{pad}work[right + {k}] = {'1.0' if square else '0.0'}")
        lines += [f"{pad}if fitted == 2:", f"{pad}    solve(work, at, right, {size})", f"{pad}else:"]
        lines += [f"{pad}    work[right + {k}] = second" for k in range(d, 2 * d)]
        lines += [f"{pad}for k in qd.static(range({size})):", f"{pad}    laplacian_vector[i][k] = work[right + k]"]
    if gradient:
        for axis in range(d):
            lines += [f"{pad}for k in range({size}):", f"{pad}    work[right + k] = 0.0"]
            lines += [f"{pad}work[right + {axis}] = 1.0"]
            lines += [f"{pad}if fitted == 2:", f"{pad}    solve(work, at, right, {size})"]
            lines += [f"{pad}elif fitted == 1:", f"{pad}    solve(work, at, right, {d})"]
            lines += [f"{pad}else:", f"{pad}    work[right + {axis}] = first"]
            lines += [f"{pad}for k in qd.static(range({size})):"]
            lines += [f"{pad}    gradient_vectors[i][{axis}, k] = work[right + k]"]
    kernel = kernels.compiled("second_order", "\n".join(lines) + "\n", **scope)
    return kernel, kernels.array(real, parts * room)


@kernels.cached
def _factorise(size: int) -> Any:
    """Return the function that turns M into L (below) and D (on the diagonal), up to the first degenerate monomial."""
    real = kernels.runtime().real
    Reals = kernels.array_type(real)
    qd = kernels.qd

    @kernels.func
    def factorise(work: Reals, at: kernels.i32) -> kernels.i32:  # type: ignore[valid-type]
        """Return how many leading monomials are independent."""
        good = 0
        going = 1
        for k in range(size):
            if going == 1:
                row = at + k * (k + 1) // 2
                for t in range(k):
                    column = at + t * (t + 1) // 2
                    s = work[row + t]
                    for u in range(t):
                        s -= work[row + u] * work[column + u]
                    # L D until the row is complete.
                    work[row + t] = s
                full = work[row + k]
                pivot = full
                for t in range(k):
                    entry = work[row + t] / work[at + t * (t + 1) // 2 + t]
                    pivot -= entry * work[row + t]
                    work[row + t] = entry
                if pivot > LEAST_PIVOT * full and full > qd.cast(1e-12, real):
                    work[row + k] = pivot
                    good += 1
                else:
                    going = 0
        return good

    return factorise


@kernels.cached
def _solve(size: int) -> Any:
    """Return the function that solves L D L^T z = right for the first ``n`` unknowns, in place."""
    Reals = kernels.array_type(kernels.runtime().real)

    @kernels.func
    def solve(work: Reals, at: kernels.i32, right: kernels.i32, n: kernels.i32):  # type: ignore[no-untyped-def, valid-type]
        for k in range(n):
            for t in range(k):
                work[right + k] = work[right + k] - work[at + k * (k + 1) // 2 + t] * work[right + t]
        for k in range(n):
            work[right + k] = work[right + k] / work[at + k * (k + 1) // 2 + k]
        for back in range(n):
            k = n - 1 - back
            for t in range(k + 1, n):
                work[right + k] = work[right + k] - work[at + t * (t + 1) // 2 + k] * work[right + t]

    return solve
