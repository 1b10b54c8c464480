"""Where a row is with respect to the free surface, and how crowded: what shifting along a surface needs."""

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, pair_max, pair_sum, pair_term, row_map, row_term
from spume.particles import ANY, FLUID, Field, Particles
from spume.schemes.crowding import TENSILE_POWER
from spume.schemes.normal import NORMAL_FIELDS, surface_normals
from spume.schemes.operator import Operator

INNER, VICINITY, SURFACE, SPLASH = 0, 1, 2, 3

SURFACE_FIELDS = (
    *NORMAL_FIELDS,
    Field("surface_class", (), "1", "fluid rows: 0 inner, 1 vicinity of the surface, 2 surface, 3 splash", int,
          output=True),
    Field("near_surface", (), "1", "1 where a neighbour is on the free surface", int),
    Field("near_inside", (), "1", "1 where a neighbour is fluid off the free surface", int),
    Field("concentration_gradient", ("d",), "1/m", "gradient of the concentration of particles"),
)  # fmt: skip


def _exists(a, largest):  # type: ignore[no-untyped-def]
    return kernels.qd.cast(largest > 0.5, kernels.i32)


@pair_term(reads=("free_surface",), finish=_exists)
def on_surface(a, b, r, w):  # type: ignore[no-untyped-def]
    return 1.0 * b.free_surface


@pair_term(reads=("free_surface",), finish=_exists)
def off_surface(a, b, r, w):  # type: ignore[no-untyped-def]
    return 1.0 - b.free_surface


@row_term(reads=("free_surface", "near_surface", "near_inside"))
def class_of_row(a):  # type: ignore[no-untyped-def]
    result = kernels.qd.select(a.near_surface == 1, VICINITY, INNER)
    if a.free_surface == 1:
        result = kernels.qd.select(a.near_inside == 1, SURFACE, SPLASH)
    return result


def classify(operator: Operator, lattice: Lattice, particles: Particles, pairs: Pairs) -> None:
    """Write ``surface_class`` of fluid rows.

    Splash: on the free surface without a fluid neighbour off it (drops, spray, sheets of one or two layers);
    surface: on the free surface otherwise; vicinity: has a neighbour on the free surface; inner: the rest.
    """
    pair_max(
        (on_surface, off_surface), particles, pairs, out=("near_surface", "near_inside"), weight=operator.weight,
        re=operator.radius(lattice), over=FLUID,
    )  # fmt: skip
    row_map(class_of_row, particles, out="surface_class", rows=FLUID)


def _scaled(a, total, scale):  # type: ignore[no-untyped-def]
    return scale * total


@pair_term(shape=("d",), finish=_scaled)
def concentration(a, b, r, w, scale):  # type: ignore[no-untyped-def]
    return w / r.dot(r) * r


def _scaled_too(a, total, scale, tensile, w0):  # type: ignore[no-untyped-def]
    return scale * total


@pair_term(shape=("d",), finish=_scaled_too)
def repelling(a, b, r, w, scale, tensile, w0):  # type: ignore[no-untyped-def]
    return (1.0 + tensile * (w / w0) ** TENSILE_POWER) * w / r.dot(r) * r


@kernels.func
def limited(shift, largest):  # type: ignore[no-untyped-def]
    """Return a displacement, shortened to ``largest`` where it is longer."""
    length = shift.norm()
    return shift * kernels.qd.min(1.0, largest / kernels.qd.max(length, 1e-30))


@kernels.func
def tangential(vector, normal):  # type: ignore[no-untyped-def]
    """Return the part of a vector across a unit normal."""
    return vector - vector.dot(normal) * normal


def concentration_and_normal(
    operator: Operator, lattice: Lattice, particles: Particles, pairs: Pairs, tensile: float = 0.0
) -> None:
    """Write ``concentration_gradient``, grad C = d/n0 sum_j [1 + R (W/W(l0))^4] W r_ij/r^2, and ``surface_normal``.

    Rows of every kind are summed over.
    """
    more = (tensile, weight_of_neighbour(operator)) if tensile > 0.0 else ()
    pair_sum(
        repelling if tensile > 0.0 else concentration, particles, pairs, out="concentration_gradient",
        weight=operator.weight, re=operator.radius(lattice), over=ANY,
        arguments=(lattice.dimension / operator.n0(lattice), *more),
    )  # fmt: skip
    surface_normals(operator, lattice, particles, pairs)


def weight_of_neighbour(operator: Operator) -> float:
    """Return W(l0), the weight of the nearest neighbour on the lattice [1]."""
    return float(operator.weight.values(1.0, operator.re))
