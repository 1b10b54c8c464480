"""A Laplacian freed of the error that an uneven arrangement makes with a gradient: the corrected vector."""

from typing import ClassVar, Literal

from pydantic import Field as Parameter

from spume import kernels
from spume.lattice import Lattice
from spume.pairs import Pairs, pair_sum, pair_term, row_map, row_term
from spume.particles import ANY, FLUID, WALL, Field, Particles
from spume.schemes.correction import CORRECTION, moment
from spume.schemes.free_surface.base import SURFACE_SHARE
from spume.schemes.laplacian.base import Laplacian, Terms

CORRECTED_VECTOR = Field("corrected_vector", ("d",), "1/m", "takes a gradient off a Laplacian; [m] with base original")


@pair_term(shape=("d",))
def lean_original(a, b, r, w, scale, limit):  # type: ignore[no-untyped-def]
    return w * r


@pair_term(shape=("d",))
def lean_distance(a, b, r, w, scale, limit):  # type: ignore[no-untyped-def]
    return w / r.dot(r) * r


@row_term(reads=("corrected_vector", "correction"))
def through_correction(a, share):  # type: ignore[no-untyped-def]
    return share * (a.correction @ a.corrected_vector)


@kernels.func
def original(a, b, r, w):  # type: ignore[no-untyped-def]
    return w


@kernels.func
def distance(a, b, r, w):  # type: ignore[no-untyped-def]
    return w / r.dot(r)


@kernels.func
def original_corrected(a, b, r, w):  # type: ignore[no-untyped-def]
    return w - a.corrected_vector.dot(r) * w / r.dot(r)


@kernels.func
def distance_corrected(a, b, r, w):  # type: ignore[no-untyped-def]
    return (1.0 - a.corrected_vector.dot(r)) * w / r.dot(r)


@kernels.func
def lagged(a, lean):  # type: ignore[no-untyped-def]
    return -(1.0 - a.surface_share) * lean.dot(a.pressure_gradient)


_LAGGED = ("surface_share", "pressure_gradient")
_TERMS = {
    ("original", "full"): Terms(original_corrected, reads=("corrected_vector",)),
    ("distance", "full"): Terms(distance_corrected, reads=("corrected_vector",)),
    ("original", "lagged"): Terms(original, rhs=lagged, row_reads=_LAGGED),
    ("distance", "lagged"): Terms(distance, rhs=lagged, row_reads=_LAGGED),
}
_LEAN = {"original": lean_original, "distance": lean_distance}


class CorrectedVector(Laplacian, name="corrected-vector"):
    """<lap phi>_i = s sum_j c_ij (phi_j - phi_i - r_ij . <grad phi>_i) (Duan et al. 2018; review Eqs. 23, 24).

    c and s are those of the model ``base``, <grad phi> is the corrected gradient
    d/n0 C_i sum_j (phi_j - phi_i)/r^2 r_ij W. Exact for linear fields on any arrangement.

    ``full`` puts the gradient into the coefficients, c_ij - d/n0 (C_i sum_k c_ik r_ik) . r_ij W/r^2: the matrix is not
    symmetric, some coefficients may be negative. ``lagged`` takes the gradient of the pressure of the step before and
    puts it on the right side of the pressure's system, fading out towards the free surface: the matrix stays
    symmetric and costs nothing more. For viscosity only ``full`` has a meaning.
    """

    ids: ClassVar[tuple[str, ...]] = ("C4",)
    reference: ClassVar = "duan2018"
    order: ClassVar = 1
    needs: ClassVar[tuple[Field, ...]] = (CORRECTION, CORRECTED_VECTOR, SURFACE_SHARE)

    base: Literal["original", "distance"] = "original"
    """Model whose coefficient is corrected."""
    correction: Literal["full", "lagged"] = "full"
    """Where the gradient stands: in the coefficients, or on the right side with the value of the step before."""
    largest_condition: float = Parameter(default=1e3, gt=1.0)
    """Largest condition number of the corrective matrix; above it a row falls back to C = I [1]."""

    def needed(self) -> tuple[Field, ...]:
        """Return the fields that the correction needs where it stands."""
        return (SURFACE_SHARE,) if self.correction == "lagged" else self.needs

    @property
    def symmetric(self) -> bool:  # type: ignore[override]
        """Whether the matrix is symmetric: with the lagged correction."""
        return self.correction == "lagged"

    @property
    def completes(self) -> bool:  # type: ignore[override]
        """Whether its coefficients make up for missing neighbours: with the full correction."""
        return self.correction == "full"

    def terms(self) -> Terms:
        """Return the formulas of the base model, corrected."""
        return _TERMS[self.base, self.correction]

    def prepare(self, lattice: Lattice, particles: Particles, pairs: Pairs, over: int = ANY) -> None:
        """Write ``corrected_vector`` = d/n0 C_i sum_j c_ij r_ij of fluid and wall rows."""
        if self.correction == "lagged":
            return
        share = lattice.dimension / self.n0(lattice)
        pair_sum(
            (moment, _LEAN[self.base]), particles, pairs, out=("correction", "corrected_vector"), weight=self.weight,
            re=self.radius(lattice), over=over, rows=FLUID | WALL,
            arguments=(share, self.largest_condition),
        )  # fmt: skip
        row_map(through_correction, particles, out="corrected_vector", rows=FLUID | WALL, arguments=(share,))

    def scale(self, lattice: Lattice) -> float:
        """Return 2 d/(lambda n0) [1/m^2] or 2 d/n0 [1]."""
        square = self.lambda_(lattice) if self.base == "original" else 1.0
        return 2.0 * lattice.dimension / (square * self.n0(lattice))
