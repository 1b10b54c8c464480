"""The images of the fluid beyond its free surface: on which side of a row they lie, and how far away the surface is."""

import functools
from math import log
from typing import Any

from spume import kernels
from spume.kernels import qd
from spume.lattice import Lattice
from spume.marks import pair_mark
from spume.pairs import Pairs, RowMap, pair_sum, pair_term, row_map, row_maps, row_term
from spume.particles import ANY, FLUID, Field, Particles
from spume.schemes.correction import squares, symmetric_matrix
from spume.schemes.crowding import CROWDING, crowding_vector, half_lattice
from spume.schemes.free_surface.base import SURFACE_SHARE, nothing
from spume.schemes.operator import Operator

IMAGES = Field("images", ("d",), "1/m", "minus d/n0 sum of W r/r^2 over the images beyond the surface")
SURFACE_DISTANCE = Field("surface_distance", (), "m", "distance of a row from the free surface")
IMAGES_DENSITY = Field("images_density", (), "1", "what the images beyond the surface add to the number density")
IMAGES_CROWDING = Field(
    "images_crowding", ("d",), "1/m", "d/n0 sum of W r/r^2 over the images of a row's neighbours", scratch="images"
)
AIR_PRESSURE = Field(
    "air_pressure", (), "Pa", "pressure beyond the free surface, of air that is enclosed there", restart=True
)
IMAGE_FIELDS = (
    CROWDING, SURFACE_SHARE, IMAGES, SURFACE_DISTANCE, AIR_PRESSURE,
    Field("fluid_crowding", ("d",), "1/m", "crowding of the fluid alone", scratch="images"),
    Field("fluid_moment", ("symmetric",), "1", "d/n0 sum of W r (x) r/r^2 over the fluid alone", scratch="images"),
    Field("wall_side", ("d",), "1", "d/n0 sum of W over solid rows, times the normal of their wall", scratch="images"),
    Field("inward_around", ("d",), "1", "sum of W theta times the direction inward over neighbours", scratch="images"),
    Field("distance_around", (), "m", "sum of W theta times the distance over neighbours", scratch="images"),
    Field("share_around", (), "1", "sum of W theta over neighbours", scratch="images"),
    Field("images_near", (), "1", "1 on the surface and where a row of it is near, else 0", scratch="images"),
)  # fmt: skip

_LEAST, _LARGEST = 0.25, 0.75
"""Limits of the distance, as multiples of l0: beyond them a row is no part of a stretched surface."""


def _scaled(a, total, scale):  # type: ignore[no-untyped-def]
    return scale * total


@pair_term(reads=("kind",), shape=("d",), finish=_scaled)
def towards_fluid(a, b, r, w, scale):  # type: ignore[no-untyped-def]
    return qd.select(b.kind == FLUID, w / r.dot(r), 0.0) * r


@pair_term(reads=("kind",), shape=("symmetric",), finish=_scaled)
def moment_of_fluid(a, b, r, w, scale):  # type: ignore[no-untyped-def]
    return qd.select(b.kind == FLUID, w / r.dot(r), 0.0) * squares(r)


@pair_term(reads=("kind", "to_surface"), shape=("d",), finish=_scaled)
def away_from_walls(a, b, r, w, scale):  # type: ignore[no-untyped-def]
    return qd.select(b.kind == FLUID, 0.0, w) * b.to_surface.normalized(1e-30)


@kernels.func
def beside_wall(a):  # type: ignore[no-untyped-def]
    return min(a.wall_side.norm() / 0.3, 1.0)


@kernels.func
def counted(b, w):  # type: ignore[no-untyped-def]
    # A row inside the fluid has neither distance nor direction.
    return qd.select(b.surface_share > 0.0, w * b.surface_share * (1.0 - beside_wall(b)), 0.0)


@pair_term(reads=("crowding", "surface_share", "wall_side"), shape=("d",))
def inward_of_neighbour(a, b, r, w):  # type: ignore[no-untyped-def]
    return counted(b, w) * b.crowding.normalized(1e-30)


@pair_term(reads=("surface_share", "wall_side"))
def share_of_neighbour(a, b, r, w):  # type: ignore[no-untyped-def]
    return counted(b, w)


@row_term(reads=("crowding", "fluid_crowding", "wall_side", "inward_around", "share_around"))
def image_vector(a, half, nearest):  # type: ignore[no-untyped-def]
    own, away = a.crowding.normalized(1e-30), a.wall_side.normalized(1e-30)
    # Where the fluid lies on the wall's open side the surface meets the wall, at first sight squarely.
    meets = min(max(a.fluid_crowding.dot(away) / half, 0.0), 1.0)
    of_wall = a.crowding - meets * a.crowding.dot(away) * away
    along = of_wall.normalized(1e-30)
    around = ((0.001 * nearest * own + a.inward_around) / (0.001 * nearest + a.share_around)).normalized(1e-30)
    aslant = beside_wall(a) * min(max((abs(around.dot(away)) - 0.2) / 0.3, 0.0), 1.0)
    inward = ((1.0 - aslant) * along + aslant * around).normalized(1e-30)
    # In a splash the neighbours may say the opposite of what the row's own side is. Then its own counts.
    trust = min(max(2.0 * a.crowding.dot(inward) / max(of_wall.norm(), 1e-30), 0.0), 1.0)
    inward = (trust * inward + (1.0 - trust) * along).normalized(1e-30)
    return max(a.crowding.dot(inward), 0.0) * inward


@row_term(reads=("images", "fluid_crowding", "fluid_moment"))
def own_distance(a, l0, flat, usual, power, least, largest):  # type: ignore[no-untyped-def]
    inward = a.images.normalized(1e-30)
    # A little of the flat surface of the lattice decides where no neighbour lies behind.
    depth = inward.dot(symmetric_matrix(a.fluid_moment) @ inward) + 0.05 * flat * usual * l0
    more = depth / (max(a.fluid_crowding.dot(inward), 0.0) + 0.05 * flat) / (usual * l0) - 1.0
    # (1 + more)^power to second order: devices have no powers of doubles.
    return l0 * min(max(0.5 * (1.0 + power * more * (1.0 + 0.5 * (power - 1.0) * more)), least), largest)


@pair_term(reads=("surface_distance", "surface_share"))
def distance_of_neighbour(a, b, r, w):  # type: ignore[no-untyped-def]
    return qd.select(b.surface_share > 0.0, w * b.surface_share * b.surface_distance, 0.0)


@pair_term(reads=("surface_share",))
def weight_of_neighbour(a, b, r, w):  # type: ignore[no-untyped-def]
    return w * b.surface_share


@row_term(reads=("surface_distance", "distance_around", "share_around"))
def mean_distance(a, nearest):  # type: ignore[no-untyped-def]
    return (nearest * a.surface_distance + a.distance_around) / (nearest + a.share_around)


@kernels.func
def to_image(b, r):  # type: ignore[no-untyped-def]
    """Return the vector to the image of a row that lies at r."""
    return r - 2.0 * b.surface_distance * b.images.normalized(1e-30)


@kernels.func
def no_spray(a, spray, supported):  # type: ignore[no-untyped-def]
    """Return 0 for rows of spray, rising to 1 where the number density goes from ``spray`` to ``supported``."""
    return min(max((a.number_density - spray) / max(supported - spray, 1e-6), 0.0), 1.0)


@kernels.cached
def _density_of_images(weight: Any) -> Any:
    """Return the term of n that the images bring, for a weight function."""

    def own_image(a, total, re):  # type: ignore[no-untyped-def]
        result = total
        away = 2.0 * a.surface_distance
        if a.surface_share > 0.0 and away < re:
            result += a.surface_share * weight(away, re)
        return result

    @pair_term(reads=("images", "surface_share", "surface_distance"), finish=own_image)
    def density_of_image(a, b, r, w, re):  # type: ignore[no-untyped-def]
        result = 0.0 * w
        if b.surface_share > 0.0:
            away = to_image(b, r).norm()
            if away < re:
                result = b.surface_share * weight(away, re)
        return result

    return density_of_image


def density_of_images(number_density: Operator, lattice: Lattice, particles: Particles, pairs: Pairs) -> None:
    """Write ``images_density``, what the images add to n: sum_j theta_j W(|r_ij - 2 delta_j n_j|), j = i included.

    The row below the surface misses neighbours too, the fewer the further apart the rows are: without the images it
    seems crowded under a crest and the source drives it apart there, which makes waves grow.
    """
    re = number_density.radius(lattice)
    row_maps((RowMap(nothing, "images_near", ANY), RowMap(nothing, "images_density")), particles)
    pair_mark("surface_share", particles, pairs, out="images_near")
    pair_sum(
        _density_of_images(number_density.weight.function()), particles, pairs, out="images_density",
        weight=number_density.weight, re=re, over=FLUID, arguments=(re,), where="images_near",
    )  # fmt: skip


@kernels.cached
def _crowding_of_images(weight: Any) -> Any:
    """Return the term of the crowding that the images bring, for a weight function."""

    @pair_term(
        reads=("images", "surface_share", "surface_distance", "number_density"), shape=("d",), finish=_scaled_image
    )
    def crowding_of_image(a, b, r, w, scale, re, spray, supported):  # type: ignore[no-untyped-def]
        result = 0.0 * r
        if b.surface_share > 0.0:
            image = to_image(b, r)
            away = image.norm()
            if away < re:
                flat = no_spray(b, spray, supported)
                result = b.surface_share * flat * weight(away, re) / (away * away) * image
        return result

    return crowding_of_image


def _scaled_image(a, total, scale, re, spray, supported):  # type: ignore[no-untyped-def]
    return scale * total


def crowding_of_images(
    operator: Operator, lattice: Lattice, particles: Particles, pairs: Pairs, spray: float, supported: float
) -> None:
    """Write ``images_crowding`` = d/n0 sum_j theta_j beta_j W(|r'|) r'/|r'|^2 [1/m], r' = r_ij - 2 delta_j n_j.

    beta rises from 0 to 1 where n_j goes from ``spray`` to ``supported``: spray has no surface. The images are those of
    the free surface at the start of the step. Rows without ``images_near`` have no sum.
    """
    re = operator.radius(lattice)
    row_map(nothing, particles, out="images_near", rows=ANY)
    pair_mark("surface_share", particles, pairs, out="images_near")
    pair_sum(
        _crowding_of_images(operator.weight.function()), particles, pairs, out="images_crowding",
        weight=operator.weight, re=re, over=FLUID, where="images_near",
        arguments=(lattice.dimension / operator.n0(lattice), re, spray, supported),
    )  # fmt: skip


@functools.cache
def flat_surface(weight: Any, re: float, dimension: int) -> tuple[float, float, float]:
    """Return l0 |s|, (n.M n)/(l0 |s|) and the power of the stretch that the latter grows with, for a flat surface [1].

    s = d/n0 sum W r/r^2 and M = d/n0 sum W r (x) r/r^2 over the neighbours of a row on the flat surface of the lattice,
    stretched along the normal n by a factor at constant volume.
    """

    def ratio(stretch: float) -> tuple[float, float]:
        r, length, scale = half_lattice(weight, re, dimension, stretch)
        w = scale * weight.values(length, re) / length**2
        lean = float((w * -r[:, -1]).sum())
        return lean, float((w * r[:, -1] ** 2).sum()) / lean

    lean, usual = ratio(1.0)
    growth = log(ratio(1.02)[1] / ratio(0.98)[1]) / log(1.02 / 0.98)
    return lean, usual, growth


def surface_images(operator: Operator, lattice: Lattice, particles: Particles, pairs: Pairs) -> None:
    """Write ``images`` b_i [1/m] and ``surface_distance`` delta_i [m] of the fluid rows on the surface, theta_i > 0.

    b_i = (s_i . n_i) n_i with s_i = d/n0 sum_j W r_ij/r^2 over every neighbour and n_i the direction inward, that of
    s_i but beside walls: a wall goes on above the water, and its rows up there pull s_i towards it. Where the fluid
    lies on a wall's open side, n_i is the direction of s_i along the wall; where the neighbours on the surface that
    have no wall beside them incline to the wall by more than 0.2 (their mean direction times the wall's normal), it
    is theirs, entirely so from 0.5 on. At the end of a sheet that runs along a wall they may say the opposite of what
    the row's own side is: where s_i . n_i is less than half of the length of s_i along the wall, that direction counts
    again.

    delta_i is l0/2 times the stretch of the arrangement along n_i, which (n . M n)/(n . f) tells, f being the sum s
    and M = d/n0 sum_j W r (x) r/r^2 over the fluid; the mean over a row and its neighbours on the surface, between
    l0/4 and 3 l0/4. Under a crest rows are further apart: with delta = l0/2 everywhere the surface would be too low
    there, and a wave of wavenumber k in water of depth h would have a period longer by k l0/4 coth(kh).
    (This project.)
    """
    recipe = (operator.weight, operator.re)
    if particles.keeps("images", recipe, ("position", "surface_share")):
        return
    crowding_vector(operator, lattice, particles, pairs)
    radius, scale, l0 = operator.radius(lattice), lattice.dimension / operator.n0(lattice), lattice.spacing
    pair_sum(
        (towards_fluid, moment_of_fluid, away_from_walls), particles, pairs,
        out=("fluid_crowding", "fluid_moment", "wall_side"), weight=operator.weight, re=radius, arguments=(scale,),
        where="surface_share",
    )  # fmt: skip
    nearest = float(operator.weight.values(1.0, operator.re))
    pair_sum(
        (inward_of_neighbour, share_of_neighbour), particles, pairs, out=("inward_around", "share_around"),
        weight=operator.weight, re=radius, over=FLUID, where="surface_share",
    )  # fmt: skip
    flat, usual, growth = flat_surface(operator.weight, operator.re, lattice.dimension)
    of_distance = (l0, flat / l0, usual, 1.0 / growth, _LEAST, _LARGEST)
    maps = (
        RowMap(image_vector, "images", arguments=(0.5 * flat / l0, nearest), where="surface_share"),
        RowMap(own_distance, "surface_distance", arguments=of_distance, where="surface_share"),
    )
    row_maps(maps, particles)
    pair_sum(
        (distance_of_neighbour, weight_of_neighbour), particles, pairs, out=("distance_around", "share_around"),
        weight=operator.weight, re=radius, over=FLUID, where="surface_share",
    )  # fmt: skip
    row_map(mean_distance, particles, out="surface_distance", arguments=(nearest,), where="surface_share")
    particles.keep("images", recipe, ("position", "surface_share"))
