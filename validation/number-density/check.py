"""What the number density says of other arrangements of the same volume, by weight function (docs/default-models.md).

    python validation/number-density/check.py

Prints n/n0 - 1 in per cent with re = 2.1 l0 in 2D: of the hexagonal lattice; of the particles of Taylor-Green vortices
(preset confined, whose source takes no part of n, 50 x 50, t = 0.3, 0.8, 1.5 L/U), mean and scatter; of the square
lattice stretched at constant volume along directions at 0, 22.5 and 45 degrees to its axes.
"""

import numpy as np
from scipy.spatial import cKDTree

from spume import load, named
from spume.build import build

RE = 2.1
STRETCHES = (1.05, 1.1, 1.2, 1.3, 1.5)


def disordered():
    """Return distances [l0] and rows of the pairs, and the number of rows, of three states of the vortices."""
    simulation = build(load("taylor-green", ["spacing=0.02"]))
    states = []
    for time in (0.3, 0.8, 1.5):
        while simulation.time < time:
            simulation.advance()
        x = np.mod(simulation.particles.numpy("position") / 0.02, 50.0)
        pairs = cKDTree(x, boxsize=50.0).query_pairs(RE, output_type="ndarray")
        r = x[pairs[:, 0]] - x[pairs[:, 1]]
        r = np.linalg.norm(r - 50.0 * np.round(r / 50.0), axis=1)
        states.append((r, pairs, len(x)))
    return states


def main():
    named.load_all()
    cells = np.stack(np.meshgrid(*[np.arange(-5.0, 6.0)] * 2), axis=-1).reshape(-1, 2)
    side = np.sqrt(2.0 / np.sqrt(3.0))
    hexagonal = side * (cells @ np.array([[1.0, 0.0], [0.5, np.sqrt(3.0) / 2.0]]))
    states = disordered()
    print("weight, hexagonal, disordered: mean, scatter, stretched to", *STRETCHES)
    for scheme in named.schemes("weight"):
        weight = scheme()

        def total(points, weight=weight):
            r = np.linalg.norm(points, axis=1)
            return float(weight.values(r[(r > 1e-9) & (r < RE)], RE).sum())

        n0 = total(cells)
        means, scatter = [], []
        for r, pairs, count in states:
            w = weight.values(r, RE)
            n = np.bincount(pairs[:, 0], w, count) + np.bincount(pairs[:, 1], w, count)
            means.append(100.0 * (n.mean() / n0 - 1.0))
            scatter.append(100.0 * n.std() / n0)
        stretched = []
        for stretch in STRETCHES:
            found = []
            for angle in np.deg2rad([0.0, 22.5, 45.0]):
                c, s = np.cos(angle), np.sin(angle)
                moved = cells @ np.array([[c, s], [-s, c]]) * [stretch, 1.0 / stretch]
                found.append(f"{100.0 * (total(moved) / n0 - 1.0):.2f}")
            stretched.append("/".join(found))
        of_hexagonal = 100.0 * (total(hexagonal) / n0 - 1.0)
        print(f"{weight.key:16} {of_hexagonal:6.2f}  {np.mean(means):6.2f} {np.mean(scatter):5.2f}  ", *stretched)


if __name__ == "__main__":
    main()
