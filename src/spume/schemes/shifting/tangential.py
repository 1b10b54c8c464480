"""Shifting along the surface, and a conservative pressure gradient across it."""

from typing import Any, ClassVar

from pydantic import Field as Parameter

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, pair_sum, pair_term, row_map, row_term
from spume.particles import ANY, FLUID, Field, Particles
from spume.schemes.shifting.base import Diffusive
from spume.schemes.shifting.classes import (
    SURFACE,
    SURFACE_FIELDS,
    classify,
    concentration_and_normal,
    limited,
)
from spume.schemes.shifting.optimised import shift_of_class


def _across(a, total, scale, dt, largest):  # type: ignore[no-untyped-def]
    change = total * 0.0
    if a.surface_class == SURFACE:
        normal = a.surface_normal
        change = -dt / a.density * (scale * total - a.pressure_gradient).dot(normal) * normal
        # The move of one step, dt times the change of velocity, is bounded like the shift itself.
        change = limited(change, largest / dt)
    return change


@pair_term(
    reads=("pressure", "pressure_gradient", "kind", "surface_class", "surface_normal", "density"),
    shape=("d",), finish=_across,
)  # fmt: skip
def repulsion(a, b, r, w, scale, dt, largest):  # type: ignore[no-untyped-def]
    # Towards a solid row the fluid row's own gradient is continued, whatever pressure the wall model writes there.
    value = kernels.qd.select(b.kind == FLUID, b.pressure, a.pressure + a.pressure_gradient.dot(r))
    return (a.pressure + value) * w / r.dot(r) * r


@row_term(reads=("velocity", "repulsion", "held_by_wall"))
def repelled(a):  # type: ignore[no-untyped-def]
    return a.velocity + kernels.qd.select(a.held_by_wall > 0, 0.0, 1.0) * a.repulsion


@row_term(reads=("shift", "repulsion"))
def shift_and_move(a, dt):  # type: ignore[no-untyped-def]
    return a.shift + dt * a.repulsion


class Tangential(Diffusive, name="tangential"):
    """OPS along the surface, and across it the conservative pressure gradient in place of the step's (Duan 2018).

    Inner, vicinity and splash rows as in ``optimised``; a surface row is shifted by -D (I - n n) . grad C and gets
    delta u_i = -dt/rho n n . [<grad P>_cons - <grad P>], moved by dt delta u_i, with
    <grad P>_cons = d/n0 sum_j (P_i + P_j)/r^2 r_ij W (Tanaka & Masunaga 2010), whose missing neighbours
    have the pressure -P_i: on a flat surface of the lattice it is the true gradient with P = 0 half a spacing
    outside, and 2 P_i n . grad C pushes a row in or out that has left its distance. Kernel: ``weight``; volume:
    V_j grad W = d/n0 W r_ij/r^2; D = h^2/2, h = re/3. Conserves nothing: the reaction on the row's neighbours is left
    out. For surfaces under pressure whose outermost rows drift across the surface; without it as ``optimised``.
    """

    ids: ClassVar = ("D4",)
    reference: ClassVar = "duan2018"
    needs: ClassVar = (
        *Diffusive.needs,
        *SURFACE_FIELDS,
        Field("repulsion", ("d",), "m/s", "change of velocity by the conservative gradient across the surface"),
    )

    strength: float = Parameter(default=0.5, ge=0.0, le=1.0)
    """Coefficient of D = strength h^2 [1]."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, number_density: Any, dt: float) -> None:
        """Shift ``position`` of fluid rows and change ``velocity`` of surface rows."""
        classify(self, lattice, particles, pairs)
        concentration_and_normal(self, lattice, particles, pairs)
        largest = self.largest * lattice.spacing
        row_map(
            shift_of_class, particles, out="shift", rows=FLUID,
            arguments=(self.strength * self.smoothing_length(lattice) ** 2, largest),
        )  # fmt: skip
        pair_sum(
            repulsion, particles, pairs, out="repulsion", weight=self.weight, re=self.radius(lattice), over=ANY,
            arguments=(lattice.dimension / self.n0(lattice), dt, largest),
        )  # fmt: skip
        row_map(shift_and_move, particles, out="shift", rows=FLUID, arguments=(dt,))
        self.shift(lattice, particles, pairs)
        row_map(repelled, particles, out="velocity", rows=FLUID)
