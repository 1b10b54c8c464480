"""The matrix that makes gradient and divergence exact for linear fields on any arrangement."""

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, PairSum, PairTerm, pair_sum, pair_term
from spume.particles import ANY, FLUID, SOLID, WALL, Field, Particles
from spume.schemes.operator import Operator

SECOND_MOMENT = Field("second_moment", ("symmetric",), "1", "sum of W r (x) r/r^2 over a row's neighbours")
WALL_MOMENT = Field(
    "wall_moment", ("symmetric",), "1", "sum of W [r (x) r - (r . n)^2 n (x) n]/r^2 over a row's solid neighbours",
    scratch="walls",
)  # fmt: skip
CORRECTION = Field("correction", ("d", "d"), "1", "corrective matrix C of the gradient", scratch="correction")


@kernels.func
def identity_like(matrix):  # type: ignore[no-untyped-def]
    identity = matrix * 0.0
    for k in kernels.static(range(matrix.n)):
        identity[k, k] = 1.0
    return identity


@kernels.func
def smallest_eigenvalue(m):  # type: ignore[no-untyped-def]
    """Return the smallest eigenvalue of a symmetric 2 x 2 or 3 x 3 matrix."""
    mean = m.trace() / m.n
    result = mean
    if kernels.static(m.n == 2):
        result = mean - kernels.sqrt(kernels.qd.max(mean * mean - m.determinant(), 0.0))
    else:
        # The trigonometric solution of the characteristic polynomial (Smith 1961), c = cos(arccos(u)/3) being found as
        # the largest root of 4 c^3 - 3 c = u by Newton's method: Vulkan has no arc cosine in double precision.
        shifted = m - mean * identity_like(m)
        size = kernels.sqrt(shifted.norm_sqr() / 6.0)
        if size > 1e-12:
            u = kernels.qd.min(kernels.qd.max(-0.5 * (shifted / size).determinant(), -1.0), 1.0)
            s = kernels.sqrt(0.5 + 0.5 * u)
            c = 0.5 + s * (0.5773502691896258 - 0.0773502691896258 * s)
            for _ in kernels.static(range(3)):
                c -= (c * (4.0 * c * c - 3.0) - u) / kernels.qd.max(12.0 * c * c - 3.0, 1e-12)
            result = mean - 2.0 * size * c
    return result


@kernels.func
def inverse_or_identity(matrix, largest_condition):  # type: ignore[no-untyped-def]
    """Return the inverse of a symmetric matrix, or I where its condition number (Frobenius) is larger."""
    result = identity_like(matrix)
    determinant = matrix.determinant()
    # The smallest eigenvalue of a moment matrix is at least det/norm^(d-1), so tiny ones are caught here.
    if abs(determinant) > 1e-12:
        inverse = matrix.inverse()
        if matrix.norm_sqr() * inverse.norm_sqr() < largest_condition * largest_condition:
            result = inverse
    return result


@kernels.func
def symmetric_matrix(v):  # type: ignore[no-untyped-def]
    """Return the 2 x 2 or 3 x 3 matrix of the components that a symmetric field keeps, row by row from the diagonal."""
    if kernels.static(v.n == 3):
        return kernels.qd.Matrix([[v[0], v[1]], [v[1], v[2]]])
    else:
        return kernels.qd.Matrix([[v[0], v[1], v[2]], [v[1], v[3], v[4]], [v[2], v[4], v[5]]])


@kernels.func
def squares(r):  # type: ignore[no-untyped-def]
    """Return r (x) r as a symmetric field keeps it."""
    if kernels.static(r.n == 2):
        return kernels.qd.Vector([r[0] * r[0], r[0] * r[1], r[1] * r[1]])
    else:
        return kernels.qd.Vector([r[0] * r[0], r[0] * r[1], r[0] * r[2], r[1] * r[1], r[1] * r[2], r[2] * r[2]])


@pair_term(shape=("symmetric",))
def second_moment(a, b, r, w):  # type: ignore[no-untyped-def]
    return squares(r) * (w / r.dot(r))


def second_moment_sum(operator: Operator, lattice: Lattice, over: int = ANY, rows: int = FLUID) -> PairSum:
    """Return the sum of W r (x) r/r^2 into ``second_moment``, of which corrective matrices are made row by row."""
    return PairSum((second_moment,), ("second_moment",), operator.weight, operator.radius(lattice), rows, over)


@kernels.func
def along_normal(b, r, normals):  # type: ignore[no-untyped-def]
    """Return the part of r along the wall's normal at a solid neighbour, if ``normals`` is 1; r if it is 0."""
    normal = b.to_surface.normalized(1e-30)
    return kernels.qd.select(b.kind == FLUID, r, r + normals * (r.dot(normal) * normal - r))


@pair_term(reads=("to_surface",), shape=("symmetric",))
def tangential_moment(a, b, r, w):  # type: ignore[no-untyped-def]
    normal = b.to_surface.normalized(1e-30)
    return (squares(r) - r.dot(normal) ** 2 * squares(normal)) * (w / r.dot(r))


def wall_moment_sum(operator: Operator, lattice: Lattice) -> PairSum:
    """Return the sum of W [r (x) r - (r . n)^2 n (x) n]/r^2 over solid neighbours into ``wall_moment``.

    A solid row says how pressure and velocity change along the normal n of its wall, and nothing of how they change
    along the wall: that is the fluid's to say. A difference towards it then counts with n n . r in the place of r, and
    what the second moment has too much is this sum.
    """
    return PairSum((tangential_moment,), ("wall_moment",), operator.weight, operator.radius(lattice), over=SOLID)


def _inverse_or_identity(a, moment, scale, largest_condition):  # type: ignore[no-untyped-def]
    return inverse_or_identity(moment * scale, largest_condition)


@kernels.func
def missing_to(matrix, floor):  # type: ignore[no-untyped-def]
    """Return how much of I raises the eigenvalues of a symmetric matrix to ``floor`` at least."""
    # Gershgorin's circles bound the eigenvalues at a tenth of the cost; only few rows come near the floor.
    bound = matrix[0, 0]
    for k in kernels.static(range(matrix.n)):
        beside = -abs(matrix[k, k])
        for m in kernels.static(range(matrix.n)):
            beside += abs(matrix[k, m])
        bound = min(bound, matrix[k, k] - beside)
    missing = 0.0 * bound
    if bound < floor:
        missing = max(floor - smallest_eigenvalue(matrix), 0.0)
    return missing


@kernels.func
def floored_inverse(matrix, floor):  # type: ignore[no-untyped-def]
    """Return the inverse of a symmetric matrix, with as much of I added as keeps its eigenvalues above ``floor``."""
    return (matrix + missing_to(matrix, floor) * identity_like(matrix)).inverse()


def _towards_identity(a, moment, scale, floor):  # type: ignore[no-untyped-def]
    scaled = moment * scale
    scaled += a.surface_share * (identity_like(scaled) - scaled)
    return floored_inverse(scaled, floor)


@pair_term(shape=("d", "d"), finish=_inverse_or_identity)
def moment(a, b, r, w, scale, limit):  # type: ignore[no-untyped-def]
    return r.outer_product(r) * (w / r.dot(r))


@pair_term(reads=("surface_share",), shape=("d", "d"), finish=_towards_identity)
def bounded_moment(a, b, r, w, scale, limit):  # type: ignore[no-untyped-def]
    return r.outer_product(r) * (w / r.dot(r))


def correction_matrix(
    operator: Operator,
    lattice: Lattice,
    particles: Particles,
    pairs: Pairs,
    over: int = ANY,
    largest_condition: float = 1e3,
    rows: int = FLUID | WALL,
) -> None:
    """Write C_i = M_i^-1, M_i = d/n0 sum_j W r (x) r/r^2, into ``correction``.

    Khayyer & Gotoh 2011, normalised by d/n0. Where M is singular or its condition number (Frobenius)
    exceeds ``largest_condition``, C = I.
    """
    _make(operator, lattice, particles, pairs, moment, over, rows, largest_condition, ("position",))


def bounded_correction_matrix(
    operator: Operator,
    lattice: Lattice,
    particles: Particles,
    pairs: Pairs,
    over: int = ANY,
    floor: float = 0.3,
    rows: int = FLUID,
) -> None:
    """Write C_i = [M_i + theta_i (I - M_i)]^-1 into ``correction``, theta the row's share in the free surface.

    The eigenvalues of the bracket are raised to ``floor`` at least, so that no arrangement of few
    neighbours multiplies a pressure difference by more than 1/floor.
    """
    _make(operator, lattice, particles, pairs, bounded_moment, over, rows, floor, ("position", "surface_share"))


def _make(
    operator: Operator, lattice: Lattice, particles: Particles, pairs: Pairs, term: PairTerm, over: int, rows: int,
    limit: float, made_of: tuple[str, ...],
) -> None:  # fmt: skip
    """Write ``correction``, unless it holds just that already: divergence and gradient may ask for the same."""
    recipe = (term.name, operator.weight, operator.re, over, rows, limit)
    if particles.keeps("correction", recipe, made_of):
        return
    pair_sum(
        term, particles, pairs, out="correction", weight=operator.weight, re=operator.radius(lattice), over=over,
        rows=rows, arguments=(lattice.dimension / operator.n0(lattice), limit),
    )  # fmt: skip
    particles.keep("correction", recipe, made_of)
