"""The rate of change of the number density by the motion of the rows, Dn/Dt."""

from spume import kernels
from spume.schemes.divergence.base import mirrored


@kernels.func
def number_density_rate(a, b, r, slope, mirror):  # type: ignore[no-untyped-def]
    """Return the share of a pair in Dn/Dt = sum_j dW/dr r_ij . u_ij/r; ``slope`` is dW/dr."""
    return slope * mirrored(a, b, mirror).dot(r) / r.norm()
