"""Explicit viscosity with the Laplacian model."""

from math import inf
from typing import ClassVar

from spume.lattice import Lattice
from spume.pairs import Pairs, pair_sum, pair_term
from spume.particles import Particles
from spume.schemes.laplacian.base import Laplacian
from spume.schemes.laplacian.original import Original
from spume.schemes.viscosity.base import Viscosity


class Explicit(Viscosity, name="explicit"):
    """nu <lap u>_i with nu the harmonic mean of the pair, evaluated at the start of the step."""

    ids: ClassVar = ("A6",)
    reference: ClassVar = "koshizuka1996"
    conserves: ClassVar = frozenset({"momentum"})

    laplacian: Laplacian = Original()
    """Laplacian model."""

    def __call__(self, lattice: Lattice, particles: Particles, pairs: Pairs, dt: float) -> None:
        """Add nu lap(u) to ``acceleration`` [m/s^2]; neighbours take part with ``slip_velocity``."""
        model = self.laplacian
        model.prepare(lattice, particles, pairs)
        pair_sum(
            _term(type(model)), particles, pairs, out="acceleration", weight=model.weight,
            re=model.radius(lattice), arguments=(model.scale(lattice),),
        )  # fmt: skip

    def max_dt(self, lattice: Lattice, viscosity: float) -> float:
        """Return l0^2/(4 d nu) [s], half the limit of the explicit scheme on the regular arrangement."""
        return lattice.spacing**2 / (4 * lattice.dimension * viscosity) if viscosity > 0 else inf


_terms: dict[type[Laplacian], object] = {}


def _term(model: type[Laplacian]):  # type: ignore[no-untyped-def]
    """Return the pair term of a Laplacian model; the same object each time, so that it compiles once."""
    if model not in _terms:
        coefficient = model.coefficient

        def add(a, total, scale):  # type: ignore[no-untyped-def]
            return a.acceleration + scale * total

        @pair_term(
            reads=("slip_velocity", "kinematic_viscosity", "acceleration", *model.reads),
            shape=("d",),
            finish=add,
        )
        def diffusion(a, b, r, w, scale):  # type: ignore[no-untyped-def]
            together = a.kinematic_viscosity + b.kinematic_viscosity
            nu = 2.0 * a.kinematic_viscosity * b.kinematic_viscosity / max(together, 1e-30)
            return nu * coefficient(a, b, r, w) * (b.slip_velocity - a.slip_velocity)

        _terms[model] = diffusion
    return _terms[model]
