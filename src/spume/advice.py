"""What can be computed, but is hardly what was meant: said when a case is checked and when its run begins."""

from __future__ import annotations

import itertools
import logging
import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from spume.moving import speeds
from spume.named import Location
from spume.occupied import among, keys_of
from spume.outputs import Snapshot
from spume.particles import FLUID, WALL
from spume.prediction import fall_speed
from spume.problems import point_text
from spume.schemes.air.adiabatic import Adiabatic
from spume.voids import enclosed_volumes

if TYPE_CHECKING:
    from spume.case import Case

log = logging.getLogger("spume")

_SAMPLES = 2000  # rows of a fluid that are looked at
_MONTH = 30 * 86400.0  # s
_HASTY = (10.0, 50.0)  # speed of a motion, in those of a fall over the fluid's height, and in m/s
_ALONG_PERIOD = 0.1  # share of gravity along a periodic axis from which on nothing falls out


def warn(case: Case, snapshot: Snapshot) -> None:
    """Warn of what the models, fluids, gauges and motions of a case are hardly meant to do.

    Args:
        case: the case.
        snapshot: its initial rows.
    """
    caution = case.step.caution()
    if caution:
        log.warning("%s: %s", case.origin.name(("step",)) or "step", caution)
    of_rows = (_falling, _blind, _leaking, _trapping, _ending, _crossing, _hasty)
    found = (_densities(case), *(judge(case, snapshot) for judge in of_rows), _elsewhen(case))
    for loc, sentence in itertools.chain.from_iterable(found):
        log.warning("%s: %s", case.origin.name(loc), sentence)


def warn_of_time(case: Case, seconds: float) -> None:
    """Warn of a run that would take longer than anybody waits; `seconds` is its predicted wall time."""
    if seconds > _MONTH:
        log.warning(
            "%s: to t = %g s at a spacing of %g m it would run for about %.3g days: end it earlier, or choose a larger "
            "spacing or a faster device",
            case.origin.name(("time", "end")),
            case.time.end,
            case.spacing,
            seconds / 86400.0,
        )


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


def _leaking(case: Case, snapshot: Snapshot) -> Iterator[tuple[Location, str]]:
    """Yield bodies that meet at a corner of the fluid with nothing in it: two walls beside it, and a gap between."""
    from spume.build import grid_of

    if len(case.body) < 2:
        return
    grid = grid_of(case)
    kind = snapshot["kind"]
    fluid = grid.cells(snapshot["position"][kind == FLUID])
    solid = keys_of(grid.cells(snapshot["position"][kind != FLUID]), grid, case)
    order = np.argsort(solid, kind="stable")
    solid, owner = solid[order], snapshot["body"][kind != FLUID][order]
    steps = np.concatenate([np.eye(case.dimension, dtype=np.int64), -np.eye(case.dimension, dtype=np.int64)])
    beside = np.full((len(steps), len(fluid)), -1)  # body in the cell beside, by direction
    for found, step in zip(beside, steps, strict=True) if len(solid) else ():
        keys = keys_of(fluid + step, grid, case)
        place = np.minimum(np.searchsorted(solid, keys), len(solid) - 1)
        found[:] = np.where(solid[place] == keys, owner[place], -1)
    said = set()
    for a, b in itertools.combinations(range(len(steps)), 2):
        corner = np.flatnonzero((beside[a] >= 0) & (beside[b] >= 0) & (beside[a] != beside[b]))
        cells = fluid[corner] + steps[a] + steps[b]
        keys, points = keys_of(cells, grid, case), grid.centres(cells)
        open_ = ~among(keys, solid) & ~among(keys, keys_of(fluid, grid, case)) if len(corner) else np.empty(0, bool)
        for body in case.body if open_.any() else ():
            open_ &= ~body.core(points, grid.spacing, grid.origin)
        for row, point in zip(corner[open_], points[open_], strict=True):
            first, second = sorted((int(beside[a, row]), int(beside[b, row])))
            if (first, second) in said:
                continue
            said.add((first, second))
            reach = max(getattr(case.body[index], "layers", 1) for index in (first, second)) * case.spacing
            yield (
                ("body", second, "shape"),
                f"and body {case.body[first].name!r} meet at a corner of the fluid with nothing in it, at "
                f"{point_text(point)} m: water is pressed out there; let one of them reach over the other by its "
                f"thickness, {reach:g} m",
            )


def _trapping(case: Case, snapshot: Snapshot) -> Iterator[tuple[Location, str]]:
    """Yield that air is enclosed from the beginning, where the step takes it for nothing."""
    air = getattr(case.step, "air", None)
    if air is None or air.key != "none":
        return
    volumes = enclosed_volumes(snapshot["position"], snapshot["kind"], snapshot.spacing, snapshot.periods)
    cells = [volume / snapshot.spacing**snapshot.dimension for volume in volumes]
    if cells and cells[0] >= Adiabatic().smallest ** snapshot.dimension:
        yield (
            ("step", "air"),
            f"a void of {volumes[0]:.3g} m^{snapshot.dimension} is enclosed from the beginning, and gives way as if it "
            'were empty: air = "adiabatic" makes it a spring',
        )


def _ending(case: Case, snapshot: Snapshot) -> Iterator[tuple[Location, str]]:
    """Yield bodies that end where a period does: rows there look across the boundary, not into the fluid."""
    position, to_surface = snapshot["position"], snapshot["to_surface"]
    depth = np.linalg.norm(to_surface, axis=1)
    for axis in snapshot.periods:
        along = to_surface[:, axis]
        looks = (snapshot["kind"] == WALL) & (np.abs(along) > 0.9 * depth) & (depth > 0.0)
        for corner, sign in ((case.domain.lower, -1.0), (case.domain.upper, 1.0)):
            if corner is None:
                continue
            ends = looks & (sign * along > 0.0)
            ends &= np.abs(position[:, axis] + along - corner[axis]) < 0.25 * snapshot.spacing
            for index in np.unique(snapshot["body"][ends]):
                yield (
                    ("body", int(index), "shape"),
                    f"it ends at the periodic boundary {'xyz'[axis]} = {corner[axis]:g} m, where its rows are a wall "
                    "across the boundary: let it reach five spacings beyond, or leave that face of a tank open",
                )


def _crossing(case: Case, snapshot: Snapshot) -> Iterator[tuple[Location, str]]:
    """Yield bodies whose motion takes them through others."""
    from spume.build import grid_of
    from spume.paths import crossings

    for index, other, t in crossings(case, grid_of(case), snapshot):
        yield (
            ("body", index, "motion"),
            f"runs into body {case.body[other].name!r} at t = {t:.3g} s: nothing stops it, and from then on particles "
            "of both lie in each other; end the motion before, take one of the two away (until), or move it",
        )


def _elsewhen(case: Case) -> Iterator[tuple[Location, str]]:
    """Yield references all of whose instants lie before or after the run."""
    for index, reference in enumerate(case.reference):
        time = reference.load().time * reference.time_scale
        reach = reference.shift_max * reference.time_scale
        if time.max() < -reach or time.min() > case.time.end + reach:
            yield (
                ("reference", index, "file"),
                f"its instants, {time.min():g} to {time.max():g} s, lie outside of the run, 0 to {case.time.end:g} s: "
                "nothing will be compared; check time_column and time_scale",
            )


def _hasty(case: Case, snapshot: Snapshot) -> Iterator[tuple[Location, str]]:
    """Yield motions faster than anything that the case's water does by itself."""
    fall = fall_speed(case, snapshot["position"][snapshot["kind"] == FLUID])
    for loc, speed in speeds(case).items():
        if speed.max() > max(_HASTY[0] * fall, _HASTY[1]):
            yield (
                loc,
                f"reaches {speed.max():.3g} m/s, where a fall over the height of the water gives {fall:.3g} m/s: is it "
                "in metres and seconds? A column without a unit is taken as metres",
            )
