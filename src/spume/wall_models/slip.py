"""Velocities that solid rows show to viscosity: images of the fluid in the wall (Lee 2011)."""

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, pair_sum, pair_term, row_map, row_term
from spume.particles import FLUID, SOLID, WALL, Field, Particles
from spume.schemes.operator import Operator

FREE_SLIP = 1
"""Value of the field ``slip`` on rows of a free-slip body; 0 is no-slip."""

SLIP_FIELDS = (
    Field("slip", (), "1", "solid rows: 0 no-slip, 1 free-slip", int, constant=True, restart=True),
    Field("slip_velocity", ("d",), "m/s", "velocity with which a row takes part in viscosity"),
    Field("near_weight", (), "1", "sum of W over the fluid near a wall row", scratch="slip"),
    Field("near_offset", ("d",), "m", "sum of W r over the fluid near a wall row", scratch="slip"),
    Field("near_velocity", ("d",), "m/s", "sum of W u over the fluid near a wall row", scratch="slip"),
    Field("near_moment", ("d", "d"), "m^2", "sum of W r (x) r over the fluid near a wall row", scratch="slip"),
    Field(
        "near_gradient", ("d", "d"), "1/s",
        "sum of W u (x) r over the fluid near a wall row, then its velocity gradient", scratch="slip",
    ),
)  # fmt: skip


@pair_term()
def weight_of_fluid(a, b, r, w):  # type: ignore[no-untyped-def]
    return w


@pair_term(shape=("d",))
def weighted_offset(a, b, r, w):  # type: ignore[no-untyped-def]
    return w * r


@pair_term(reads=("velocity",), shape=("d",))
def weighted_velocity(a, b, r, w):  # type: ignore[no-untyped-def]
    return w * b.velocity


@pair_term(shape=("d", "d"))
def weighted_moment(a, b, r, w):  # type: ignore[no-untyped-def]
    return w * r.outer_product(r)


@pair_term(reads=("velocity",), shape=("d", "d"))
def weighted_product(a, b, r, w):  # type: ignore[no-untyped-def]
    return w * b.velocity.outer_product(r)


@row_term(reads=("near_weight", "near_offset", "near_velocity", "near_moment", "near_gradient"))
def fitted_gradient(a, least):  # type: ignore[no-untyped-def]
    total = max(a.near_weight, 1e-30)
    spread = (a.near_moment - a.near_offset.outer_product(a.near_offset) / total) / total
    together = (a.near_gradient - a.near_velocity.outer_product(a.near_offset) / total) / total
    gradient = together * 0.0
    size = spread.trace() / spread.n
    # A single row has no spread, but its rounding errors are no measure of anything; a single file of rows has
    # none across itself. No gradient is taken from either.
    if size > least and abs((spread / max(size, least)).determinant()) > 1e-3:
        gradient = together @ spread.inverse()
    return gradient


def image_velocities(operator: Operator, lattice: Lattice, particles: Particles, pairs: Pairs) -> None:
    """Write ``slip_velocity`` of every row.

    Fluid rows show their own velocity. For a solid row a linear fit to the velocity of the fluid near its
    wall row gives the velocity u_f at its mirror point r + 2 to_surface; the row shows 2 u_wall - u_f
    (no-slip) or u_f with its part normal to the wall, relative to the wall, reversed (free-slip). The
    velocity at the wall's surface then equals that of the wall exactly for linear profiles. A wall that
    no fluid touches shows its own velocity.
    """
    names = ("near_weight", "near_offset", "near_velocity", "near_moment", "near_gradient")
    terms = (weight_of_fluid, weighted_offset, weighted_velocity, weighted_moment, weighted_product)
    pair_sum(
        terms,
        particles,
        pairs,
        out=names,
        weight=operator.weight,
        re=operator.radius(lattice),
        rows=WALL,
        over=FLUID,
    )
    row_map(
        fitted_gradient, particles, out="near_gradient", rows=WALL, arguments=(1e-3 * lattice.spacing**2,)
    )  # fmt: skip
    _image_kernel(particles.dimension, kernels.light(particles.active))(
        particles["kind"], particles["slip"], particles["master"], particles["position"], particles["to_surface"],
        particles["velocity"], particles["wall_velocity"], particles["near_weight"], particles["near_offset"],
        particles["near_velocity"], particles["near_gradient"], particles["slip_velocity"],
        particles.rows_by_id(), particles.active,
    )  # fmt: skip


@kernels.cached
def _image_kernel(d: int, serial: bool):  # type: ignore[no-untyped-def]
    real = kernels.runtime().real
    Vectors, Rows, Reals = (kernels.array_type(t) for t in (kernels.vector(d), kernels.i32, real))
    Tensors = kernels.array_type(kernels.value_type((d, d)))
    qd = kernels.qd

    @kernels.kernel
    def images(
        kind: Rows, slip: Rows, master: Rows, position: Vectors, to_surface: Vectors, velocity: Vectors,
        wall_velocity: Vectors, near_weight: Reals, near_offset: Vectors, near_velocity: Vectors,
        near_gradient: Tensors, slip_velocity: Vectors, row_of_id: Rows, count: kernels.i32,
    ):  # fmt: skip
        qd.loop_config(serialize=serial)
        for i in range(count):
            shown = velocity[i]
            if kind[i] & SOLID != 0:
                wall = wall_velocity[i]
                j = row_of_id[master[i]]
                shown = wall
                if near_weight[j] > 0:
                    mean = near_velocity[j] / near_weight[j]
                    centre = position[j] + near_offset[j] / near_weight[j]
                    fluid = mean + near_gradient[j] @ (position[i] + 2.0 * to_surface[i] - centre)
                    shown = 2.0 * wall - fluid
                    if slip[i] == FREE_SLIP:
                        normal = to_surface[i].normalized(1e-30)
                        shown = fluid - 2.0 * (fluid - wall).dot(normal) * normal
            slip_velocity[i] = shown

    return images
