"""Makes house.stl of the built-in case dam-break-stl: a small house on a deep foundation.

    python tests/geometry/make_house.py src/spume/cases/dam-break-stl/house.stl

In millimetres, as drawing programs write: the middle of the ground floor is the origin, z is up.
"""

import sys
from pathlib import Path

import numpy as np
import trimesh

LENGTH, WIDTH, EAVES, RIDGE, FOUNDATION = 160.0, 200.0, 140.0, 220.0, 100.0


def house() -> trimesh.Trimesh:
    """Return the house, gables to the left and right, its ridge across the flow (along y)."""
    walls = trimesh.creation.box(
        bounds=[[-LENGTH / 2, -WIDTH / 2, -FOUNDATION], [LENGTH / 2, WIDTH / 2, EAVES]],
    )
    corners = [[x, y, EAVES] for x in (-LENGTH / 2, LENGTH / 2) for y in (-WIDTH / 2, WIDTH / 2)]
    roof = trimesh.convex.convex_hull(np.array([*corners, [0, -WIDTH / 2, RIDGE], [0, WIDTH / 2, RIDGE]]))
    return trimesh.boolean.union([walls, roof], engine="manifold")


def write(file: Path) -> None:
    """Write the house as a binary STL file, the triangles in an order that depends on no library."""
    mesh = house()
    corners = np.round(mesh.triangles, 6) + 0.0
    first = [min(range(3), key=lambda k: tuple(c[k])) for c in corners]
    corners = np.array([np.roll(c, -k, axis=0) for c, k in zip(corners, first, strict=True)])
    corners = corners[np.lexsort(corners.reshape(-1, 9).T[::-1])]
    ordered = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), process=False)
    file.write_bytes(trimesh.exchange.stl.export_stl(ordered))


if __name__ == "__main__":
    write(Path(sys.argv[1]))
