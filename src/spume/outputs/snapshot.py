"""The state of a run at one instant, as NumPy arrays that are copied only when somebody asks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

# The same numbers as in spume.particles, whose import loads the kernel language: readers of results
# do without it (tests/outputs/test_snapshot.py compares them).
FLUID = 1
WALL = 2
DUMMY = 4


class FieldLike(Protocol):
    """What a snapshot needs to know of a field; ``spume.particles.Field`` has it."""

    @property
    def unit(self) -> str:
        """SI unit."""
        ...

    @property
    def doc(self) -> str:
        """What it is, in one sentence."""
        ...

    @property
    def output(self) -> bool:
        """Whether it is worth writing to frames."""
        ...


class PoseLike(Protocol):
    """What a snapshot needs to know of where a body is; ``spume.motion.Pose`` has it."""

    def origin(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return where points of the body [m], shape (n, d), were at the start."""
        ...

    def unturned(self, vectors: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return vectors, shape (n, d) or (d,), in the axes that the body had at the start."""
        ...


_TURNING = ("velocity", "acceleration", "pressure_gradient", "to_surface")


class Snapshot:
    """Read-only view of all rows at one instant.

    Fields are fetched on first use and kept, so several outputs of one step share one copy. A
    snapshot that is to outlive its step must have fetched what will be asked of it:
    :meth:`keep`.

    Args:
        fetch: returns the copy of a field, shape (rows, *shape), in the table's present order;
            KeyError for a name that is no field.
        time: t [s].
        step: number of steps made.
        dt: length of the last step [s].
        spacing: l0 [m].
        dimension: 2 or 3.
        gravity: g [m/s^2], shape (dimension,).
        n0: particle number density of the regular arrangement [1].
        bodies: labels of the bodies, in the order of the field ``body``.
        fields: field name to its description (unit, doc, output).
        poses: label of each body that moves to where it is, relative to the start.
        periods: number of each periodic axis to the length of its period [m].
        stiffness: of a central gravity, -stiffness (x - focus) beside ``gravity`` [1/s^2].
        focus: of a central gravity [m].
    """

    def __init__(
        self,
        fetch: Callable[[str], NDArray[Any]],
        *,
        time: float,
        step: int,
        dt: float,
        spacing: float,
        dimension: int,
        gravity: ArrayLike,
        n0: float = float("nan"),
        bodies: tuple[str, ...] = (),
        fields: Mapping[str, FieldLike] | None = None,
        poses: Mapping[str, PoseLike | None] | None = None,
        periods: Mapping[int, float] | None = None,
        stiffness: float = 0.0,
        focus: ArrayLike = 0.0,
    ) -> None:
        self.time = float(time)
        self.step = int(step)
        self.dt = float(dt)
        self.spacing = float(spacing)
        self.dimension = int(dimension)
        self.gravity: NDArray[np.float64] = np.asarray(gravity, dtype=float)
        self.n0 = float(n0)
        self.bodies = tuple(bodies)
        self.fields: Mapping[str, FieldLike] = {} if fields is None else fields
        self.poses = {name: pose for name, pose in (poses or {}).items() if pose is not None}
        self.stiffness = float(stiffness)
        self.focus: NDArray[np.float64] = np.asarray(focus, dtype=float)
        self.periods: Mapping[int, float] = dict(periods or {})
        self._fetch: Callable[[str], NDArray[Any]] | None = fetch
        self._arrays: dict[str, NDArray[Any]] = {}
        self._derived: dict[Any, Any] = {}

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name not in self._arrays:
            if self._fetch is None:
                raise KeyError(
                    f"field {name!r} of the snapshot at step {self.step} was not kept; "
                    f"kept: {', '.join(sorted(self._arrays))}"
                )
            values = np.asarray(self._fetch(name))
            values.setflags(write=False)
            self._arrays[name] = values
        return self._arrays[name]

    def __contains__(self, name: str) -> bool:
        return name in self._arrays or name in self.fields

    def __len__(self) -> int:
        return len(self["position"])

    @property
    def fluid(self) -> NDArray[np.bool_]:
        """Mask of the fluid rows, shape (rows,)."""
        return self.derived("fluid", lambda s: s["kind"] == FLUID)

    @property
    def wall(self) -> NDArray[np.bool_]:
        """Mask of the first solid layer, the rows that carry pressure, shape (rows,)."""
        return self.derived("wall", lambda s: s["kind"] == WALL)

    @property
    def up(self) -> NDArray[np.float64]:
        """Unit vector against gravity; the last axis where there is no gravity."""
        size = float(np.linalg.norm(self.gravity))
        if size == 0.0:
            return np.eye(self.dimension)[-1]
        return -self.gravity / size

    def derived(self, key: Any, compute: Callable[[Snapshot], Any]) -> Any:
        """Return ``compute(self)``, computed once per snapshot and key (what several gauges share)."""
        if key not in self._derived:
            self._derived[key] = compute(self)
        return self._derived[key]

    def seen_from(self, body: str | None) -> Snapshot:
        """Return the snapshot in the coordinates of a body: places and directions as they were at the start.

        Velocities stay those relative to the frame of the run, in the body's axes. Of a body that rests, and of
        None, the coordinates are those of the run.
        """
        pose = None if body is None else self.poses.get(body)
        if pose is None:
            return self
        return self.derived(("seen from", body), lambda s: _turned(s, pose))

    def shortest(self, offsets: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return offsets [m], shape (n, d) or fewer axes, through a periodic boundary where that is nearer."""
        offsets = np.array(offsets, dtype=float)
        for axis, period in self.periods.items():
            if axis < offsets.shape[1]:
                offsets[:, axis] -= period * np.round(offsets[:, axis] / period)
        return offsets

    def around(self, point: ArrayLike) -> Snapshot:
        """Return the snapshot with the image of every row that is nearest to a point [m], shape (d,)."""
        if not self.periods:
            return self
        centre = np.asarray(point, dtype=float)
        return self.derived(("around", tuple(centre)), lambda s: _moved(s, centre + s.shortest(s["position"] - centre)))

    def keep(self, names: tuple[str, ...]) -> Snapshot:
        """Return a snapshot with these fields fetched, which stays valid after the next step."""
        kept = _like(self, self.__getitem__, self.gravity)
        kept.poses, kept.periods = self.poses, self.periods
        for name in names:
            kept[name]
        kept._fetch = None
        return kept

    def unit(self, name: str) -> str:
        """Return the SI unit of a field, ``""`` where it is unknown."""
        field = self.fields.get(name)
        return "" if field is None else field.unit

    def doc(self, name: str) -> str:
        """Return the one-sentence description of a field, ``""`` where it is unknown."""
        field = self.fields.get(name)
        return "" if field is None else field.doc


def _turned(snapshot: Snapshot, pose: PoseLike) -> Snapshot:
    """Return a snapshot in the coordinates of a body that has this pose."""

    def fetch(name: str) -> NDArray[Any]:
        values = snapshot[name]
        if name == "position":
            return pose.origin(np.asarray(values, dtype=float))
        return pose.unturned(np.asarray(values, dtype=float)) if name in _TURNING else values

    return _like(snapshot, fetch, pose.unturned(snapshot.gravity))


def _moved(snapshot: Snapshot, position: NDArray[np.float64]) -> Snapshot:
    """Return a snapshot whose rows are at other places."""
    return _like(snapshot, lambda name: position if name == "position" else snapshot[name], snapshot.gravity)


def _like(snapshot: Snapshot, fetch: Callable[[str], NDArray[Any]], gravity: NDArray[np.float64]) -> Snapshot:
    """Return a snapshot of the same instant with other places and directions; poses and periods are left out."""
    return Snapshot(
        fetch,
        time=snapshot.time,
        step=snapshot.step,
        dt=snapshot.dt,
        spacing=snapshot.spacing,
        dimension=snapshot.dimension,
        gravity=gravity,
        n0=snapshot.n0,
        bodies=snapshot.bodies,
        fields=snapshot.fields,
        stiffness=snapshot.stiffness,
        focus=snapshot.focus,
    )
