"""Solids from STL files."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Annotated, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PrivateAttr, field_validator, model_validator
from typing_extensions import override

from spume.geometry.facets import Facets
from spume.geometry.grid import Grid
from spume.geometry.shapes import Points, Shape
from spume.named import File

_LEVEL = 1e-6  # a facet is level along an axis if its normal is off by less than this
_SMALLEST_FACE = 4.0  # smaller level faces than this many squares of the spacing stay where they are
_SENTENCES = 4


class Stl(Shape, name="stl"):
    """The solid that a triangulated surface encloses, read from an STL file (3D).

    The file's numbers are first multiplied by `scale`, then turned about the origin of coordinates, then
    moved. Bodies that overlap in the file count as one. STL files carry no unit: drawings in millimetres
    need ``scale = 0.001``.
    """

    dimensions: ClassVar[tuple[int, ...]] = (3,)

    file: File
    """STL file, text or binary; its surface must be closed."""
    scale: Annotated[float, Field(gt=0)] = 1.0
    """Length of the file's unit [m]."""
    rotate_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Angles about the axes x, y and z, turned one after the other in this order [degrees]."""
    translate: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Displacement [m], after scaling and turning."""

    _facets: Facets = PrivateAttr()
    _inverted: bool = PrivateAttr(default=False)

    @field_validator("file", mode="after")
    @classmethod
    def _check_file(cls, file: Path) -> Path:
        _read(file, file.stat().st_mtime_ns)
        return file

    @model_validator(mode="after")
    def _place(self) -> Self:
        read, self._inverted = _read(self.file, self.file.stat().st_mtime_ns)
        from scipy.spatial.transform import Rotation

        turn = Rotation.from_euler("xyz", self.rotate_deg, degrees=True).as_matrix()
        turn = np.where(np.abs(turn) < 1e-15, 0.0, turn)  # quarter turns are exact
        vertices = (read.vertices * self.scale) @ turn.T + np.array(self.translate)
        self._facets = Facets(vertices, read.simplices)
        return self

    @override
    def bounds(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return self._facets.bounds()

    @override
    def facets(self) -> Facets:
        return self._facets

    @override
    def nearest(self, points: Points) -> Points:
        return self._facets.nearest(points)

    @override
    def inside(self, points: Points) -> NDArray[np.bool_]:
        lower, upper = self.bounds()
        result = np.all((points > lower) & (points < upper), axis=1)
        if result.any():
            result[result] = self._facets.winding(points[result]) > 0
        return np.asarray(result)

    @override
    def distance_within(self, points: Points, reach: float) -> NDArray[np.float64]:
        result = np.where(self.inside(points), -np.inf, np.inf)
        lower, upper = self.bounds()
        near = np.all((points > lower - reach) & (points < upper + reach), axis=1)
        near[near] = self._facets.lower_gap(points[near]) < reach
        gap = np.linalg.norm(self.nearest(points[near]) - points[near], axis=1)
        result[near] = np.copysign(gap, result[near])
        return np.asarray(result)

    @override
    def measure(self) -> float:
        return self._facets.measure()

    @override
    def surface(self) -> float:
        return self._facets.surface()

    @override
    def snapped(self, grid: Grid) -> tuple[Self, list[str]]:
        """Return the solid with its large level faces moved to the nearest cell faces.

        A face that would meet another one there stays where it is.
        """
        vertices, said = _snapped(self._facets, grid)
        result = self.model_copy()
        result._facets = vertices
        return result, (["its triangles looked inwards: turned round"] if self._inverted else []) + said


@lru_cache(maxsize=16)
def _snapped(facets: Facets, grid: Grid) -> tuple[Facets, list[str]]:
    """Return a surface with its large level faces on cell faces, and what that moved visibly."""
    vertices, normals = facets.vertices.copy(), facets.normals
    area = np.linalg.norm(normals, axis=1)
    moved: list[str] = []
    for k in range(3):
        level = np.abs(normals[:, k]) > (1.0 - _LEVEL) * area
        height = facets.corners[level, :, k].mean(axis=1)
        for heights, total in _levels(height, area[level], 1e-4 * grid.spacing):
            if total < _SMALLEST_FACE * grid.spacing**2:
                continue
            at = float(np.mean(heights))
            sentences: list[str] = []
            cells = round((grid.snap(at, k, f"a face at {'xyz'[k]}", sentences) - grid.origin[k]) / grid.spacing)
            to = grid.origin[k] + cells * grid.spacing  # binary files hold seven digits: 0.60000002
            own = np.abs(facets.vertices[:, k] - at) < 2e-4 * grid.spacing
            others = np.abs(vertices[~own, k] - at)
            if len(others) and others.min() < 2.0 * abs(to - at):
                continue
            vertices[own, k] = to
            moved += sentences
    if len(moved) > _SENTENCES:
        moved = [*moved[:_SENTENCES], f"{len(moved) - _SENTENCES} more faces were moved likewise"]
    return Facets(vertices, facets.simplices), moved


def _levels(
    height: NDArray[np.float64], area: NDArray[np.float64], tolerance: float
) -> list[tuple[NDArray[np.float64], float]]:
    """Return heights and total area of the groups of facets that lie in one plane."""
    order = np.argsort(height)
    cuts = np.flatnonzero(np.diff(height[order]) > tolerance) + 1
    groups = np.split(order, cuts) if len(order) else []
    return [(height[group], float(area[group].sum())) for group in groups]


@lru_cache(maxsize=16)
def _read(file: Path, stamp: int) -> tuple[Facets, bool]:
    """Return the closed surface of a file, looking outwards, and whether it had to be turned round.

    Raises:
        ValueError: no triangles, a surface with holes, no volume.
    """
    import trimesh

    try:
        mesh = trimesh.load_mesh(str(file), file_type="stl", process=False)
        corners = np.asarray(mesh.triangles, dtype=float).reshape(-1, 3, 3)
    except Exception as error:  # trimesh raises whatever its reader stumbles over
        raise ValueError(f"cannot be read as an STL file: {error}") from None
    if len(corners) == 0:
        raise ValueError("holds no triangle")
    if not np.isfinite(corners).all():
        raise ValueError("holds a corner that is not a finite number")
    size = float(np.ptp(corners.reshape(-1, 3), axis=0).max())
    mesh = trimesh.Trimesh(*_merged(corners, 1e-7 * size), process=False)
    if len(mesh.faces) == 0:
        raise ValueError("holds no triangle that has an area")
    if not mesh.is_watertight:
        edges = mesh.edges_sorted
        unique, count = np.unique(edges, axis=0, return_counts=True)
        wrong = unique[count != 2]
        where = mesh.vertices[wrong].mean(axis=1)[0]
        raise ValueError(
            f"the surface is not closed: {len(wrong)} of its {len(unique)} edges do not join two triangles, the "
            f"first at ({', '.join(f'{x:.4g}' for x in where)}) in the file's unit; repair it in the program "
            "that wrote it"
        )
    if not mesh.is_winding_consistent:
        trimesh.repair.fix_winding(mesh)
    facets = Facets(np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.int64))
    volume = facets.measure()
    if abs(volume) < 1e-9 * size**3:
        raise ValueError("encloses no volume")
    if volume < 0.0:
        return Facets(facets.vertices, facets.simplices[:, ::-1].copy()), True
    return facets, False


def _merged(corners: NDArray[np.float64], tolerance: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return vertices and triangles, corners nearer than the tolerance made one, triangles without area left out."""
    points = corners.reshape(-1, 3)
    vertices, number = np.unique(points, axis=0, return_inverse=True)
    from scipy.spatial import cKDTree

    pairs = cKDTree(vertices).query_pairs(tolerance, output_type="ndarray")
    if len(pairs):
        from scipy.sparse import coo_array
        from scipy.sparse.csgraph import connected_components

        graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(vertices),) * 2)
        _, label = connected_components(graph, directed=False)
        _, first = np.unique(label, return_index=True)
        vertices, number = vertices[first], label[number.reshape(-1)]
    faces = number.reshape(-1, 3).astype(np.int64)
    distinct = (faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])
    return vertices, faces[distinct]
