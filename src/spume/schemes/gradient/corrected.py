"""The gradient corrected to be exact for linear fields."""

from typing import ClassVar, Literal

from pydantic import Field as Parameter

from spume.lattice import Lattice
from spume.pairs import Pairs, PairView, pair_sum, pair_term
from spume.particles import ANY, Particles
from spume.schemes.correction import CORRECTION, correction_matrix
from spume.schemes.gradient.base import Gradient


def _corrected(a, total, scale):  # type: ignore[no-untyped-def]
    return a.correction @ total * scale


@pair_term(reads=("value", "correction"), shape=("d",), finish=_corrected)
def difference(a, b, r, w, scale):  # type: ignore[no-untyped-def]
    return (b.value - a.value) * w / r.dot(r) * r


def _published(a, total, scale):  # type: ignore[no-untyped-def]
    # The trace of d/n0 sum_j W r (x) r/r^2 is d n_i/n0.
    return a.correction.inverse().trace() * (a.correction @ total) * scale


@pair_term(reads=("value", "correction"), shape=("d",), finish=_published)
def published_difference(a, b, r, w, scale):  # type: ignore[no-untyped-def]
    return (b.value - a.value) * w / r.dot(r) * r


class Corrected(Gradient, name="corrected"):
    """<grad phi>_i = d/n0 sum_j (phi_j - phi_i)/r^2 C_i r_ij W (gradient correction, GC; review Eqs. 12-14).

    C_i = [d/n0 sum_j W r (x) r/r^2]^-1. Exact for linear fields on any arrangement; conserves no momentum.
    The choice for accurate pressures; it needs particle shifting, for it does not push particles apart.

    The review prints the same sum with C_i = [1/n_i sum_j W r (x) r/r^2]^-1, which counts the normalisation twice: the
    matrix is d I on the lattice and the gradient d n_i/n0 times the exact one, twice in 2D and three times in 3D.
    ``form = "published"`` is that, for comparison; ``consistent`` has d/n0 in both sums. A calibrated form would be the
    consistent one: the matrix is what calibrates, row by row.
    """

    ids: ClassVar = ("B6",)
    reference: ClassVar = "khayyer2011"
    order: ClassVar = 1
    needs: ClassVar = (CORRECTION,)

    form: Literal["published", "consistent"] = "consistent"
    """``published``: as printed, d n_i/n0 times too large; ``consistent``: exact for linear fields."""
    largest_condition: float = Parameter(default=1e3, gt=1.0)
    """Largest condition number of the matrix; above it a row falls back to C = I [1]."""

    def caution(self) -> str:
        """Return what is wrong with the model itself, or nothing."""
        if self.form == "published":
            return 'in the form "published" gives d times the gradient: choose form = "consistent"'
        return ""

    def __call__(
        self, lattice: Lattice, particles: Particles, pairs: Pairs,
        phi: str = "pressure", out: str = "pressure_gradient", over: int = ANY, view: PairView | None = None,
        dt: float = 0.0, moved: bool = True,
    ) -> None:  # fmt: skip
        """Write the gradient of ``phi`` at fluid rows into ``out``."""
        correction_matrix(self, lattice, particles, pairs, over, self.largest_condition)
        term = difference if self.form == "consistent" else published_difference
        pair_sum(
            term, particles, pairs, out=out, weight=self.weight, re=self.radius(lattice), over=over,
            arguments=(lattice.dimension / self.n0(lattice),), fields={"value": phi}, view=view,
        )  # fmt: skip
