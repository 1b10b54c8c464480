"""Where a row is to the face of a wall that a solid row stands for: its part of the surface, a cell wide."""

from spume import kernels

HALF_WIDTH = 0.54
"""Half of the width of a face, in 3D times the root of two for its corners: a little more than half a cell [l0]."""


@kernels.func
def behind_face(b, r):  # type: ignore[no-untyped-def]
    """Return how far [m] the row that sees b at r is behind the surface at b; negative in front of it."""
    return r.dot(b.to_surface.normalized(1e-30)) + b.to_surface.norm()


@kernels.func
def within_face(b, r, l0):  # type: ignore[no-untyped-def]
    """Return whether the row that sees b at r lies on the normal through the face of b."""
    along = r.dot(b.to_surface.normalized(1e-30))
    return r.norm_sqr() - along * along < (r.n - 1) * (HALF_WIDTH * l0) ** 2
