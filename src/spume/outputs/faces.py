"""The wetted faces of walls and bodies in 3D, tile by tile, from the rows of a frame.

A solid row of the first layer has a tile for every side of its cell at which no solid row stands: the side, moved along
its axis into the plane in which the row meets the water. So tiles close a plane, slanted or not, without gaps. At an
edge a row knows only one plane of two; the other is that of a row beside it, and both tiles end where they meet.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spume.outputs.snapshot import FLUID
from spume.outputs.vtkhdf import Frame

Floats = NDArray[np.float64]

_STEEPEST = 0.57  # a plane is met along an axis that its normal has this much of, 1/√3 at least for the largest
_NEAR = 1.8  # within which faces bound each other [l0]
_DEEPEST = 3.5  # rows beyond have no part in a face [l0]
_CELLS = 30_000_000  # of a grid at most; it is coarsened beyond
_TABLES = ("centre", "first", "second", "normal", "plane", "body", "edge", "obstacle", "outer")
_SHUT = 0.2  # of a body's tiles that hide a fluid: it is a tank then, not an obstacle
_SHARE = 0.02  # of the fluid that a body holds, to be looked into


@dataclass(frozen=True)
class Faces:
    """Tiles of wetted faces, parallelograms.

    Attributes:
        spacing: l0 [m].
        centre: their middles [m], shape (tiles, 3).
        first, second: their sides [m], shape (tiles, 3).
        normal: unit normals, towards the water, shape (tiles, 3).
        plane: a point of the wetted plane of each [m], shape (tiles, 3).
        body: index of the body, shape (tiles,).
        edge: which may reach beyond an edge, where faces near by bound them, shape (tiles,).
        obstacle: which belong to bodies that stand in the water, shape (tiles,).
        outer: which belong to what holds the water, but are its outside or touch another part, shape (tiles,).
    """

    spacing: float
    centre: Floats
    first: Floats
    second: Floats
    normal: Floats
    plane: Floats
    body: NDArray[np.int64]
    edge: NDArray[np.bool_]
    obstacle: NDArray[np.bool_]
    outer: NDArray[np.bool_]

    def __len__(self) -> int:
        return len(self.centre)

    def __getitem__(self, chosen: NDArray[np.bool_]) -> Faces:
        """Return some of the tiles, by a mask of shape (tiles,)."""
        return Faces(self.spacing, *(getattr(self, name)[chosen] for name in _TABLES))

    def points(self, chosen: NDArray[np.bool_], pieces: int) -> tuple[Floats, NDArray[np.int64]]:
        """Return points that cover some tiles [m], `pieces` along each side of a cell, and the tile of each."""
        inner, edge = np.flatnonzero(chosen & ~self.edge), np.flatnonzero(chosen & self.edge)
        share = (np.arange(pieces) + 0.5) / pieces - 0.5
        made = [self._spread(inner, share)]
        if len(edge):
            # Over the edge by half a cell, and cut where the next plane is met.
            share = np.arange(-pieces + 0.5, pieces) / pieces
            points, owner = self._spread(edge, share)
            inside = np.abs(share) < 0.5
            kept = self._bounded(points, edge, chosen, np.outer(inside, inside).reshape(-1))
            made.append((points[kept], owner[kept]))
        return np.concatenate([p for p, _ in made]), np.concatenate([o for _, o in made])

    def _spread(self, tiles: NDArray[np.int64], share: Floats) -> tuple[Floats, NDArray[np.int64]]:
        u, v = (part.reshape(-1, 1) for part in np.meshgrid(share, share, indexing="ij"))
        points = self.centre[tiles, None] + u * self.first[tiles, None] + v * self.second[tiles, None]
        return points.reshape(-1, 3), np.repeat(tiles, len(share) ** 2)

    def _bounded(
        self, points: Floats, edge: NDArray[np.int64], chosen: NDArray[np.bool_], inside: NDArray[np.bool_]
    ) -> NDArray[np.bool_]:
        """Return which points of tiles are on this side of the planes that meet theirs; in corners of those chosen.

        Args:
            points: as many for each tile, shape (points, 3).
            edge: the tiles.
            chosen: which tiles are drawn, of all.
            inside: which of a tile's points do not reach over it.
        """
        from scipy.spatial import cKDTree

        kept = np.ones(len(points), dtype=bool)
        pairs = cKDTree(self.centre[edge]).sparse_distance_matrix(
            cKDTree(self.centre), _NEAR * self.spacing, output_type="ndarray"
        )
        tile, other = edge[pairs["i"]], pairs["j"]
        # Of two faces at a ridge each lies behind the other's plane, of two in a corner before it.
        apart = self.plane[other] - self.plane[tile]
        here = np.einsum("ij,ij->i", apart, self.normal[tile])
        there = -np.einsum("ij,ij->i", apart, self.normal[other])
        least = 0.02 * self.spacing
        ridge, corner = (here < -least) & (there < -least), (here > least) & (there > least) & chosen[other]
        along = np.cross(self.normal[tile], self.normal[other])
        along /= np.maximum(np.linalg.norm(along, axis=1), 1e-12)[:, None]
        span = sum(np.abs(np.einsum("ij,ij->i", side[other], along)) for side in (self.first, self.second))
        per = len(points) // len(edge)
        place, flat = points.reshape(len(edge), per, 3), kept.reshape(len(edge), per)
        number = np.searchsorted(edge, tile)
        for sign, bounding in ((1.0, ridge), (-1.0, corner)):
            for part in np.array_split(np.flatnonzero(bounding), max(int(bounding.sum()) * per // 2_000_000, 1)):
                away = place[number[part]] - self.centre[other[part], None]
                beyond = sign * np.einsum("ijk,ik->ij", away, self.normal[other[part]]) > 1e-3 * self.spacing
                # An edge ends where its tiles do: that of a rim at an inner corner.
                reach = 0.55 * span[part, None] + np.where(inside, 0.0, 0.55 * self.spacing)
                beside = np.abs(np.einsum("ijk,ik->ij", away, along[part])) < reach
                np.logical_and.at(flat, number[part], ~(beyond & beside))
        return kept


def faces_of(frame: Frame) -> Faces:
    """Return the wetted faces of all walls and bodies of a frame in 3D; none without ``kind`` and ``to_surface``."""
    nothing = np.zeros((0, 3))
    no = np.zeros(0, dtype=bool)
    empty = Faces(frame.spacing, *(nothing,) * 5, np.zeros(0, dtype=np.int64), no, no, no)
    if not {"kind", "to_surface"} <= set(frame.arrays):
        return empty
    kind = np.asarray(frame["kind"])
    position, to_surface = (np.asarray(frame[name], dtype=float) for name in ("position", "to_surface"))
    body = np.asarray(frame["body"], dtype=np.int64) if "body" in frame else np.full(len(kind), -1)
    solid = kind != FLUID
    made = [
        _tiles(int(index), position[mine], to_surface[mine], frame.spacing)
        for index in np.unique(body[solid])
        if (mine := solid & (body == index)).any()
    ]
    made = [tiles for tiles in made if len(tiles)]
    if not made:
        return empty
    every = Faces(frame.spacing, *(np.concatenate([getattr(tiles, name) for tiles in made]) for name in _TABLES))
    return _sorted_out(every, position[solid], body[solid], position[~solid])


def _tiles(index: int, position: Floats, to_surface: Floats, l0: float) -> Faces:
    """Return the tiles of a body from its rows."""
    length = np.linalg.norm(to_surface, axis=1)
    rows = np.flatnonzero(length < _DEEPEST * l0)
    first_layer = (length[rows] > 0.02 * l0) & (length[rows] < l0)  # a row on the surface does not know where up is
    axes = lattice_axes(position, l0)
    # In the axes of the body's lattice, whose cells are l0 wide.
    cell = np.rint((position - position[0]) @ axes.T / l0).astype(np.int64)
    cell -= cell.min(axis=0) - 1
    step = np.cumprod([1, *(cell.max(axis=0)[:2] + 2)])
    number = cell @ step
    normal = to_surface[rows] / np.where(length > 0.0, length, 1.0)[rows, None]
    surface = position[rows] + to_surface[rows]
    turned = normal @ axes.T
    found = []  # row, axis, sign, row whose plane it is
    second = []
    for axis in range(3):
        for sign in (-1, 1):
            bare = np.flatnonzero(~np.isin(number[rows] + sign * step[axis], number))
            met = first_layer[bare] & (sign * turned[bare, axis] > _STEEPEST)
            found.append((bare[met], axis, sign, bare[met]))
            second.append((bare[~met], axis, sign))
    found += _second_planes(second, position[rows], surface, normal, turned, first_layer, l0)
    centre, first, other, way, plane = [], [], [], [], []
    for row, axis, sign, master in found:
        n = normal[master]
        along = sign * axes[axis]
        steep = n @ along
        reach = np.einsum("ij,ij->i", surface[master] - position[rows][row], n) / steep
        sides = [l0 * (axes[k] - (n @ axes[k] / steep)[:, None] * along) for k in range(3) if k != axis]
        centre.append(position[rows][row] + reach[:, None] * along)
        first.append(sides[0])
        other.append(sides[1])
        way.append(n)
        plane.append(surface[master])
    middle, side, across, n, point = (np.concatenate(parts) for parts in (centre, first, other, way, plane))
    no = np.zeros(len(middle), dtype=bool)
    return Faces(l0, middle, side, across, n, point, np.full(len(middle), index), no, no, no)


def _second_planes(
    sides: list[tuple[NDArray[np.int64], int, int]], position: Floats, surface: Floats, normal: Floats, turned: Floats,
    first_layer: NDArray[np.bool_], l0: float,
) -> list[tuple[NDArray[np.int64], int, int, NDArray[np.int64]]]:  # fmt: skip
    """Return the row beside whose plane bare sides of cells meet that look away from the plane of their own row.

    Args:
        sides: rows, axis and sign of the sides.
        position, surface, normal: of the rows of a body, shape (rows, 3).
        turned: the normals in the axes of its lattice, shape (rows, 3).
        first_layer: which rows stand at the surface of their body, shape (rows,).
        l0: spacing [m].
    """
    from scipy.spatial import cKDTree

    found = []
    for row, axis, sign in sides:
        facing = np.flatnonzero(first_layer & (sign * turned[:, axis] > _STEEPEST))
        if not len(row) or not len(facing):
            continue
        count = min(6, len(facing))
        _, near = cKDTree(surface[facing]).query(position[row], k=count, distance_upper_bound=_NEAR * l0)
        near = near.reshape(len(row), count)
        there = near < len(facing)
        near = facing[np.where(there, near, 0)]
        apart = surface[near] - surface[row][:, None]
        # The row lies below that plane, not deep; and both are behind the other's plane, or it is no edge of the body.
        # A row in another body, as in a roof that a column goes through, and one at a ridge have no plane of their own.
        here = np.einsum("ijk,ik->ij", apart, normal[row])
        back = -np.einsum("ijk,ijk->ij", apart, normal[near])
        depth = np.einsum("ijk,ijk->ij", surface[near] - position[row][:, None], normal[near])
        ridge = (here < -0.02 * l0) & (back < -0.02 * l0)
        fits = there & (depth > -0.02 * l0) & (depth < l0) & (ridge | ~first_layer[row][:, None])
        best = fits.argmax(axis=1)
        some = fits.any(axis=1)
        found.append((row[some], axis, sign, near[np.arange(len(row)), best][some]))
    return found


def lattice_axes(position: Floats, l0: float) -> Floats:
    """Return the axes of the lattice on which rows of a body stand, which turn with it, shape (3, 3).

    Args:
        position: the rows [m], shape (rows, 3).
        l0: spacing [m].
    """
    from scipy.spatial import cKDTree

    apart = (position - position[0]) / l0
    if np.abs(apart - np.rint(apart)).max() < 0.02:
        return np.eye(3)
    tree = cKDTree(position)
    for start in np.linspace(0, len(position) - 1, min(len(position), 50)).astype(int):
        near = [k for k in tree.query_ball_point(position[start], 1.01 * l0) if k != start]
        ways = (position[near] - position[start]) / l0
        for i, way in enumerate(ways):
            others = [w for w in ways[i + 1 :] if abs(w @ way) < 0.02]
            if others and abs(way @ way - 1.0) < 0.02:
                second = others[0] - (others[0] @ way) * way / (way @ way)
                first, second = way / np.linalg.norm(way), second / np.linalg.norm(second)
                return np.array([first, second, np.cross(first, second)])
    return np.eye(3)


# ------------------------------------------------------------------------------------------ what hides the water


def _sorted_out(faces: Faces, solid: Floats, body: NDArray[np.int64], fluid: Floats) -> Faces:
    """Say which tiles meet others at an edge, which belong to obstacles, which are outsides of what holds the fluid."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    count = len(faces)
    i, j = cKDTree(faces.centre).query_pairs(_NEAR * faces.spacing, output_type="ndarray").T
    alike = np.einsum("ij,ij->i", faces.normal[i], faces.normal[j])
    edge = np.zeros(count, dtype=bool)
    edge[np.concatenate([i[alike < 0.999], j[alike < 0.999]])] = True
    smooth = alike > 0.8
    _, side = connected_components(coo_array((smooth[smooth], (i[smooth], j[smooth])), shape=(count, count)), False)

    def whole_sides(outer: NDArray[np.bool_], side: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Take the rest of a side along, before what is no space: the thickness of another wall."""
        share = np.bincount(side, outer) / np.maximum(np.bincount(side), 1)
        return share[side] > _SHUT

    found, space = _outsides(faces, solid, fluid)
    outer = whole_sides(found, side)
    obstacle = np.zeros(count, dtype=bool)
    for index in np.unique(faces.body[faces.body >= 0]):
        mine = faces.body == index
        away = faces.centre[mine] - faces.centre[mine].mean(axis=0)
        if np.einsum("ij,ij->", away, faces.normal[mine]) <= 0.0:
            continue  # its faces look at their middle
        low, high = faces.centre[mine].min(axis=0), faces.centre[mine].max(axis=0)
        # What a body in the midst of the water has under the floor is no outside.
        bounds = bool(np.any(low[:2] < space[0, :2]) or np.any(high[:2] > space[1, :2]))
        if not bounds or outer[mine].mean() <= _SHUT:  # it may be a vessel in a larger tank
            outer[mine] = whole_sides(_outsides(faces[mine], solid[body == index], fluid, _SHARE)[0], side[mine])
        obstacle |= mine & (outer[mine].mean() <= _SHUT)
    # Where two parts of a tank touch, neither is wetted.
    _, row = cKDTree(solid).query(
        faces.centre + 0.5 * faces.spacing * faces.normal, 1, distance_upper_bound=0.6 * faces.spacing
    )
    touched = (row < len(solid)) & (np.append(body, -1)[row] != faces.body)
    outer = ~obstacle & (outer | touched)
    fields = (faces.centre, faces.first, faces.second, faces.normal, faces.plane, faces.body)
    return Faces(faces.spacing, *fields, edge, obstacle, outer)


def _outsides(faces: Faces, solid: Floats, fluid: Floats, share: float = 0.0) -> tuple[NDArray[np.bool_], Floats]:
    """Return which tiles have a space with fluid behind them that walls surround, and do not look into it themselves.

    Also returned are the corners of that space [m], shape (2, 3).

    Args:
        faces: the tiles.
        solid, fluid: positions of the rows [m], shape (rows, 3).
        share: part of the fluid that must be there.
    """
    from scipy.ndimage import label

    none, nowhere = np.zeros(len(faces), dtype=bool), np.array([[np.inf] * 3, [-np.inf] * 3])
    if not len(fluid) or not len(solid):
        return none, nowhere
    lower = solid.min(axis=0)
    size = np.ptp(solid, axis=0)
    cell = max(faces.spacing, float(np.prod(size + faces.spacing) / _CELLS) ** (1.0 / 3.0))
    lower = lower - 1.5 * cell
    shape = tuple(int(n) for n in np.ceil(size / cell) + 3)
    full = np.zeros(shape, dtype=bool)
    full[tuple(np.floor((solid - lower) / cell).astype(int).T)] = True
    around = ~full
    for axis in (0, 1):
        around &= np.logical_or.accumulate(full, axis=axis)
        around &= np.flip(np.logical_or.accumulate(np.flip(full, axis), axis=axis), axis)
    if not around.any():
        return none, nowhere
    space, _ = label(around)
    where = np.floor((fluid - lower) / cell).astype(int)
    where = where[np.all((where >= 0) & (where < shape), axis=1)]
    held = space[tuple(where.T)]
    if np.count_nonzero(held) <= share * len(fluid):
        return none, nowhere
    cavity = np.isin(space, np.unique(held[held > 0]))

    def at(points: Floats) -> tuple[NDArray[np.int64], ...]:
        index = np.clip(np.floor((points - lower) / cell).astype(int), 0, np.array(shape) - 1)
        return tuple(index.T)

    behind = none.copy()
    going = ~cavity[at(faces.centre + cell * faces.normal)]
    for step in range(1, max(shape)):
        if not going.any():
            break
        rows = np.flatnonzero(going)
        place = at(faces.centre[rows] - step * 0.75 * cell * faces.normal[rows])
        reached = cavity[place]
        behind[rows[reached]] = True
        # On through what is solid or hollow, not through the open.
        going[rows] = ~reached & (full[place] | around[place])
    reach = [np.flatnonzero(cavity.any(axis=others))[[0, -1]] + [0, 1] for others in ((1, 2), (0, 2), (0, 1))]
    return behind, lower + cell * np.transpose(reach)
