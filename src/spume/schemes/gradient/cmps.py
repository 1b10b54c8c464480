"""The conservative gradient with smallest neighbouring values (CMPS)."""

from typing import ClassVar, Literal

from spume.lattice import Lattice
from spume.pairs import Pairs, PairView, pair_sum, pair_term, row_map, row_term
from spume.particles import ANY, FLUID, Particles
from spume.schemes.gradient.base import Gradient
from spume.schemes.gradient.smallest import SMALLEST_VALUE, find_smallest


def _scaled(a, total, scale):  # type: ignore[no-untyped-def]
    return total * scale


@pair_term(reads=("value", "smallest_value", "kind"), shape=("d",), finish=_scaled)
def above_both(a, b, r, w, scale):  # type: ignore[no-untyped-def]
    # A solid row stands for an image of the row that looks at it, and so do its surroundings.
    other = a.smallest_value
    if b.kind == FLUID:
        other = b.smallest_value
    return (a.value + b.value - a.smallest_value - other) * w / r.dot(r) * r


@row_term()
def everywhere(a, value):  # type: ignore[no-untyped-def]
    return value


class Conservative(Gradient, name="cmps"):
    """<grad P>_i = d/n0 sum_j [(P_i + P_j) - (Pmin_i + Pmin_j)]/r^2 r_ij W (Khayyer & Gotoh 2008; review Eq. 9).

    Pmin_i is the least of P_i and the P_j. The forces of a pair are equal, opposite and along the line between the
    two: momentum and angular momentum are conserved; and they repel. Constants have no gradient anywhere.

    The published form cannot reproduce a linear field: with it P - Pmin is the same for both rows, the sum over a
    regular arrangement vanishes and so does the gradient. Any pair force that is central, equal and opposite, and
    unchanged by a constant added to P, has this property by parity. The published form holds a fluid
    where Pmin is nearly zero everywhere (within re of a surface, in a fluid full of clipped pressures) and lets the
    inside of a deep one sink until its pressure has bent. ``form = "consistent"`` takes one Pmin for all, the
    lowest pressure of the fluid: as conservative and repulsive, and exact for linear fields on the regular
    arrangement. Unusable under tension in either form.
    """

    ids: ClassVar = ("B3",)
    reference: ClassVar = "khayyer2008"
    order: ClassVar = 0
    conserves: ClassVar = frozenset({"momentum", "angular momentum"})
    repels: ClassVar = True
    needs: ClassVar = (SMALLEST_VALUE,)

    form: Literal["published", "consistent"] = "published"
    """``published``: Pmin of each row's neighbours; ``consistent``: the lowest pressure of the whole fluid."""

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs,
        phi: str = "pressure", out: str = "pressure_gradient", over: int = ANY, view: PairView | None = None,
        dt: float = 0.0, moved: bool = True,
    ) -> None:  # fmt: skip
        """Write the gradient of ``phi`` at fluid rows into ``out``; dummies are no candidates for the minimum."""
        if self.form == "published":
            find_smallest(self, lattice, particles, pairs, phi, over, view)
        else:
            row_map(everywhere, particles, out="smallest_value", arguments=(particles.smallest(phi, FLUID),))
        pair_sum(
            above_both, particles, pairs, out=out, weight=self.weight, re=self.radius(lattice), over=over,
            arguments=(lattice.dimension / self.n0(lattice),), fields={"value": phi}, view=view,
        )  # fmt: skip
