"""The family of wall functions: the stress of a boundary layer that the particles do not resolve."""

from collections.abc import Callable
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spume import kernels
from spume.named import Scheme


class WallFunction(Scheme, family="wall_function"):
    """The shear stress of a no-slip wall as a function of the velocity beside it.

    Free-slip walls have none, whatever the function.
    """

    resolved: ClassVar[bool] = False
    """Whether the layer is left to the particles and the images of the fluid in the wall, with no function at all."""
    formula: ClassVar[Callable[..., Any]]
    """tau/rho [m^2/s^2] of speed along the wall u [m/s], distance y [m] and kinematic viscosity nu [m^2/s], all of
    them positive, in operations that both NumPy and the kernel language know."""

    def function(self) -> Any:
        """Return tau/rho as a function of the kernel language."""
        return _compiled(type(self))

    def values(self, u: ArrayLike, y: ArrayLike, nu: float) -> NDArray[np.float64]:
        """Return tau/rho [m^2/s^2] for arrays of speeds [m/s] and distances [m], of their common shape."""
        u, y = np.broadcast_arrays(np.asarray(u, float), np.asarray(y, float))
        return np.asarray(type(self).formula(u, y, nu))


@kernels.cached
def _compiled(scheme: type[WallFunction]) -> Any:
    return kernels.func(scheme.formula)
