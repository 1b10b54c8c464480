"""The family of weight functions."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spume import kernels
from spume.named import Scheme


class Weight(Scheme, family="weight"):
    """A weight function W(r, re) for 0 < r < re; scale-free: W(a r, a re) = W(r, re) for any a > 0."""

    formula: ClassVar[Callable[..., Any]]
    """The function of r and re, in operations that both NumPy and the kernel language know."""
    slope: ClassVar[Callable[..., Any]]
    """Its derivative dW/dr [1/m], for schemes that follow the number density in time."""

    def function(self) -> Any:
        """Return the weight as a function of the kernel language."""
        return _compiled(type(self))

    def derivative(self) -> "Derivative":
        """Return dW/dr as something that pair sums take in the place of a weight."""
        return Derivative(type(self))

    def values(self, r: ArrayLike, re: float) -> NDArray[np.float64]:
        """Return W(r, re) for an array of distances below re, of the same shape."""
        return np.asarray(type(self).formula(np.asarray(r, dtype=float), re))


@dataclass(frozen=True)
class Derivative:
    """The derivative dW/dr [1/m] of a weight function."""

    weight: type[Weight]

    def function(self) -> Any:
        """Return the derivative as a function of the kernel language."""
        return _compiled_slope(self.weight)


@kernels.cached
def _compiled(scheme: type[Weight]) -> Any:
    return kernels.func(scheme.formula)


@kernels.cached
def _compiled_slope(scheme: type[Weight]) -> Any:
    return kernels.func(scheme.slope)
