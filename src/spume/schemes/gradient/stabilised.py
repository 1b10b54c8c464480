"""The original gradient with dynamic stabilisation: a repulsion of pairs that come too close."""

from typing import ClassVar, Literal

from pydantic import Field as Parameter

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, PairView, pair_sum, pair_term
from spume.particles import ANY, FLUID, Particles
from spume.schemes.gradient.base import Gradient


@kernels.func
def penetration(a, b, r, distance, behind, ahead):  # type: ignore[no-untyped-def]
    """Return how far a pair is nearer than ``distance``, along the direction that it had at r^k."""
    approach = b.velocity - a.velocity
    axis = (r - behind * approach).normalized(1e-30)
    after = r + ahead * approach
    depth = 0.0 * axis
    if after.dot(after) < distance * distance:
        along = after.dot(axis)
        across = after - along * axis
        depth = (kernels.sqrt(distance * distance - across.dot(across)) - along) * axis
    return depth


def _scaled(a, total, scale, n0, rate, distance, behind, ahead):  # type: ignore[no-untyped-def]
    return total * scale


@pair_term(reads=("value", "velocity", "density"), shape=("d",), finish=_scaled)
def weighted_repulsion(a, b, r, w, scale, n0, rate, distance, behind, ahead):  # type: ignore[no-untyped-def]
    mass = a.density * b.density / (a.density + b.density)
    force = mass * rate * penetration(a, b, r, distance, behind, ahead)
    return ((b.value - a.value) / r.dot(r) * r + force / (n0 * scale)) * w


@pair_term(reads=("value", "velocity", "density", "kind"), shape=("d",), finish=_scaled)
def full_repulsion(a, b, r, w, scale, n0, rate, distance, behind, ahead):  # type: ignore[no-untyped-def]
    # A solid row does not yield: the whole way back is the fluid's.
    mass = a.density
    if b.kind == FLUID:
        mass *= b.density / (a.density + b.density)
    force = mass * rate * penetration(a, b, r, distance, behind, ahead)
    return (b.value - a.value) * w / r.dot(r) * r + force / scale


class Stabilised(Gradient, name="stabilised"):
    """<grad P>_i = d/n0 sum_j (P_j - P_i)/r^2 r_ij W + 1/n0 sum_j F_ij W (Tsuruta 2013; review Eq. 11).

    F_ij = rho_i rho_j/(rho_i + rho_j) [sqrt(d^2 - |r_perp|^2) - r_par]/dt^2 e_ij where the pair would end the step
    nearer than d = alpha l0, else 0; e_ij is its direction at r^k, r_par and r_perp are the parts of r*_ij along and
    across it. As a part of the gradient F points towards the neighbour, so that -grad P/rho pushes it
    away. Where the fluid moves on after the projection, r* = r^k + dt u*. Pairs that keep their distance feel
    the original gradient and nothing else; the stabilising force is equal and opposite (angular momentum is
    not conserved where a pair turns within a step, and the original gradient conserves neither).

    The print weights F with W/n0: a step undoes a fifth of a penetration in 2D, a tenth in 3D (``published``). With
    ``form = "consistent"`` one step moves a lone pair back to d exactly. Prefer it to the minimum
    pressure in violent flows: it is silent inside a well-ordered fluid.
    """

    ids: ClassVar = ("B5",)
    reference: ClassVar = "tsuruta2013"
    order: ClassVar = 0

    alpha: float = Parameter(default=0.9, gt=0.0, le=1.0)
    """Distance d that is kept, as a multiple of l0; 1 less the Courant number is a good choice [1]."""
    form: Literal["published", "consistent"] = "published"
    """``published``: weighted with W/n0; ``consistent``: unweighted, walls do not yield."""

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs,
        phi: str = "pressure", out: str = "pressure_gradient", over: int = ANY, view: PairView | None = None,
        dt: float = 0.0, moved: bool = True,
    ) -> None:  # fmt: skip
        """Write the gradient of ``phi`` at fluid rows into ``out``; without a time step there is no stabilisation."""
        n0 = self.n0(lattice)
        rate = 1.0 / dt**2 if dt > 0.0 else 0.0
        behind, ahead = (dt, 0.0) if moved else (0.0, dt)
        pair_sum(
            weighted_repulsion if self.form == "published" else full_repulsion, particles, pairs, out=out,
            weight=self.weight, re=self.radius(lattice), over=over, fields={"value": phi}, view=view,
            arguments=(lattice.dimension / n0, n0, rate, self.alpha * lattice.spacing, behind, ahead),
        )  # fmt: skip
