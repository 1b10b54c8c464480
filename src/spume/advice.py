"""What can be computed, but is hardly what was meant: said when a case is checked and when its run begins."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from spume.named import Location
from spume.outputs import Snapshot
from spume.particles import FLUID

if TYPE_CHECKING:
    from spume.case import Case

log = logging.getLogger("spume")

_SAMPLES = 2000  # rows of a fluid that are looked at
_ALONG_PERIOD = 0.1  # share of gravity along a periodic axis from which on nothing falls out


def warn(case: Case, snapshot: Snapshot) -> None:
    """Warn of models that do not fit each other, of several densities, of fluid that falls, of gauges that see nothing.

    Args:
        case: the case.
        snapshot: its initial rows.
    """
    caution = case.step.caution()
    if caution:
        log.warning("%s: %s", case.origin.name(("step",)) or "step", caution)
    for loc, sentence in (*_densities(case), *_falling(case, snapshot), *_blind(case, snapshot)):
        log.warning("%s: %s", case.origin.name(loc), sentence)


def _densities(case: Case) -> Iterator[tuple[Location, str]]:
    """Yield that flows of several densities are not validated, where there are several."""
    densities = sorted({fluid.density for fluid in case.fluid})
    if len(densities) > 1:
        listed = ", ".join(f"{density:g}" for density in densities)
        yield (
            ("fluid",),
            f"densities of {listed} kg/m^3: flows of several densities are computed but not validated yet; compare "
            "with measurements before a result is used",
        )


def _falling(case: Case, snapshot: Snapshot) -> Iterator[tuple[Location, str]]:
    """Yield fluids below which, along gravity, there is no solid at all."""
    gravity = snapshot.gravity
    size = float(np.linalg.norm(gravity))
    along_period = [gravity[axis] for axis in snapshot.periods]
    if size == 0.0 or snapshot.stiffness or np.linalg.norm(along_period) > _ALONG_PERIOD * size:
        return
    position, kind = snapshot["position"], snapshot["kind"]
    down = gravity / size
    floor = _Deepest(position[kind != FLUID], down, snapshot.spacing)
    for index, fluid in enumerate(case.fluid):
        rows = np.flatnonzero((kind == FLUID) & (snapshot["material"] == index))
        rows = rows[:: math.ceil(len(rows) / _SAMPLES) or 1]
        if not len(rows) or floor.below(position[rows]).any():
            continue
        yield (
            ("fluid", index, "shape"),
            f"no body lies below fluid {fluid.name!r} along gravity: it will fall, leave the region and be removed; "
            "move the fluid or the body, whose shapes may not be where they are meant to be (spume check draws them)",
        )


class _Deepest:
    """How deep the lowest of some points lies, by where they stand across gravity.

    Args:
        points: shape (n, d) [m].
        down: unit vector along gravity, shape (d,).
        width: of the cells by which they are looked up [m].
    """

    def __init__(self, points: NDArray[np.float64], down: NDArray[np.float64], width: float) -> None:
        self._down, self._width = down, width
        # Two (2D: one) directions across: the last ones of an orthonormal basis that begins with gravity.
        basis, _ = np.linalg.qr(np.column_stack([down, np.eye(len(down))]))
        self._across = basis[:, 1:]
        self._depth: dict[tuple[int, ...], float] = {}
        cells, number = np.unique(self._cells(points), axis=0, return_inverse=True)
        depth = np.full(len(cells), -np.inf)
        np.maximum.at(depth, number.reshape(-1), points @ down)
        self._depth = dict(zip(map(tuple, cells.tolist()), depth.tolist(), strict=True))

    def below(self, points: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return for points [m], shape (n, d), whether one of the others lies deeper, at most two cells aside."""
        offsets = np.stack(np.meshgrid(*[(-1, 0, 1)] * self._across.shape[1], indexing="ij"), -1)
        near = self._cells(points)[:, None, :] + offsets.reshape(-1, self._across.shape[1])
        deepest = [max(self._depth.get(tuple(cell), -np.inf) for cell in cells) for cells in near.tolist()]
        return np.asarray(np.array(deepest) > points @ self._down)

    def _cells(self, points: NDArray[np.float64]) -> NDArray[np.int64]:
        return np.floor(points @ self._across / self._width).astype(np.int64)


def _blind(case: Case, snapshot: Snapshot) -> Iterator[tuple[Location, str]]:
    """Yield gauges that no fluid can come to."""
    from spume.build import grid_of

    for index, gauge in enumerate(case.gauge):
        said = gauge.blind(snapshot)
        at: Any = getattr(gauge, "at", ())
        if not said and len(at) == case.dimension:  # deep in a body there are no rows that tell
            grid = grid_of(case)
            point = np.array([at], dtype=float)
            deep = [body.name for body in case.body if body.core(point, grid.spacing, grid.origin).any()]
            on_surface = len(snapshot["kind"]) and _nearest_solid(snapshot, point[0]) < 2.0 * grid.spacing
            said = f"lies deep inside body {deep[0]!r}" if deep and not on_surface else ""
        if said:
            yield ("gauge", index, "at"), f"{said}: gauge {gauge.name!r} will see no fluid; {_REMEDY}"


_REMEDY = "move it to the surface of the wall or into the fluid"


def _nearest_solid(snapshot: Snapshot, point: NDArray[np.float64]) -> float:
    """Return the distance [m] from a point, shape (d,), to the nearest row of a body."""
    solid = snapshot["position"][snapshot["kind"] != FLUID]
    return float(np.linalg.norm(solid - point, axis=1).min(initial=math.inf))
