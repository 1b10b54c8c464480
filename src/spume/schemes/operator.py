"""What every particle interaction model has: a weight function and an effective radius."""

from pydantic import Field

from spume.lattice import Lattice
from spume.named import Scheme
from spume.pairs import PairSum
from spume.schemes.weight.base import Weight
from spume.schemes.weight.inverse import Inverse


class Operator(Scheme):
    """A model that sums over the neighbours nearer than ``re`` with a weight function.

    One that does without the one or the other says so in ``unused``.
    """

    weight: Weight = Inverse()
    """Weight function W(r, re)."""
    re: float = Field(default=2.1, ge=1.1, le=6.0)
    """Effective radius as a multiple of the spacing l0 [1]."""

    def radius(self, lattice: Lattice) -> float:
        """Return the effective radius [m]."""
        return self.re * lattice.spacing

    def sums(self, lattice: Lattice) -> tuple[PairSum, ...]:
        """Return what it sums over positions alone, at the start of a step.

        A step makes such sums of several models in one pass; a model that asks `pair_sums` for its own finds them kept.
        """
        return ()

    def n0(self, lattice: Lattice) -> float:
        """Return the reference number density for this weight and radius [1]."""
        return lattice.n0(self.weight, self.re)

    def lambda_(self, lattice: Lattice) -> float:
        """Return lambda for this weight and radius [m^2]."""
        return lattice.lambda_(self.weight, self.re)
