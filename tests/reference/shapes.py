"""Bodies of water with known surfaces, cut from a slightly disturbed lattice."""

import numpy as np

from reference.cloud import Cloud

SHAPES = ("flat", "corner", "film", "drop", "bubble")


def depths(shape, x, l0):
    """Return how deep points lie below the surface of a shape; negative outside."""
    distance = np.linalg.norm(x, axis=1)
    if shape == "flat":
        return -x[:, -1]
    if shape == "corner":
        return np.minimum(-x[:, 0], -x[:, -1])
    if shape == "film":  # three layers
        return 1.5 * l0 - np.abs(x[:, -1] + 0.5 * l0)
    if shape == "drop":
        return 4.6 * l0 - distance
    return distance - 2.6 * l0  # bubble


class Water(Cloud):
    """The part of a cloud that lies in a shape.

    Attributes:
        surface, inside: rows of the outermost layer, and rows with at least one layer above them; neither where the
            lattice cuts a curved surface in between, nor near the edges of the block.
    """

    def __init__(self, shape, d, cells=None):
        super().__init__(d, disturbance=0.1, cells=cells or {2: 12, 3: 10}[d])
        depth = depths(shape, self.x, self.l0)
        wet = depth > 0.0
        for name in ("x", "u", "phi", "rho", "nu", "share", "inner"):
            setattr(self, name, getattr(self, name)[wet])
        depth = depth[wet]
        edge = self.cells / 2 * self.l0 - np.abs(self.x).max(axis=1)
        far = np.full(len(self), True) if shape == "drop" else edge > self.re + 0.2 * self.l0
        self.surface = far & (depth < 0.65 * self.l0)
        self.inside = far & (depth > 1.35 * self.l0)
        self.inner = np.full(len(self), True)
