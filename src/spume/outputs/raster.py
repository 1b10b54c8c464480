"""Paints particles into an image: quicker than drawing markers, and true to size."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]
Colours = NDArray[np.float32]

_WHITE = 255


@dataclass(frozen=True)
class Window:
    """A rectangle of the x-y plane and the pixels that show it.

    Attributes:
        lower, upper: corners [m], shape (2,).
        scale: pixels per metre.
    """

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    scale: float

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width [pixels]."""
        size = np.maximum(np.rint((self.upper - self.lower) * self.scale).astype(int), 1)
        return int(size[1]), int(size[0])


def paint_cells(
    window: Window, position: NDArray[np.floating], radius: NDArray[np.floating] | float, square: bool = False
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Return which particle each pixel shows (−1: none) and its distance from the particle's centre.

    A pixel within the radius of several particles shows the nearest, so a dense arrangement fills its
    area without gaps or overlaps.

    Args:
        window: what to show.
        position: centres [m], shape (rows, 2).
        radius: radius of the discs, or half width of the squares [m], scalar or shape (rows,).
        square: paint squares.
    """
    height, width = window.shape
    owner = np.full(height * width, -1, dtype=np.int64)
    distance = np.full(height * width, np.inf, dtype=np.float32)
    xy = (np.asarray(position, dtype=float)[:, :2] - window.lower) * window.scale
    r = np.broadcast_to(np.asarray(radius, dtype=float) * window.scale, (len(xy),))
    if len(xy) == 0:
        return owner.reshape(height, width), distance.reshape(height, width)
    reach = float(r.max())
    visible = np.flatnonzero(
        np.all(np.isfinite(xy), axis=1) & np.all((xy > -reach) & (xy < np.array([width, height]) + reach), axis=1)
    )
    xy, r = xy[visible], r[visible]
    base = np.floor(xy).astype(np.int64)
    inside = (xy - base - 0.5).astype(np.float32)  # centre, from the middle of its pixel
    steps = np.arange(-int(np.ceil(reach)), int(np.ceil(reach)) + 1)
    stencil = np.array([(i, j) for i in steps for j in steps if max(i * i, j * j) <= (reach + 1.0) ** 2])
    if len(xy) < len(stencil):  # few large particles: one after the other is quicker
        for number in range(len(xy)):
            size = int(np.ceil(r[number])) + 1
            part, x, y = _patch(base[number], size, width, height)
            dx, dy = x + 0.5 - xy[number, 0], y[:, None] + 0.5 - xy[number, 1]
            away = np.maximum(np.abs(dx), np.abs(dy)) if square else np.hypot(dx, dy)
            mine = (away <= r[number]) & (away < distance.reshape(height, width)[part])
            owner.reshape(height, width)[part][mine] = visible[number]
            distance.reshape(height, width)[part][mine] = away[mine]
        stencil = stencil[:0]
    # From far to near: where two particles claim a pixel through different stencil points the nearer
    # one is painted later; ties within a pixel are settled by the comparison of distances.
    for i, j in stencil[np.argsort(-np.hypot(stencil[:, 0], stencil[:, 1]), kind="stable")]:
        x, y = base[:, 0] + i, base[:, 1] + j
        dx, dy = i - inside[:, 0], j - inside[:, 1]
        away = np.maximum(np.abs(dx), np.abs(dy)) if square else np.hypot(dx, dy)
        claim = (away <= r) & (x >= 0) & (x < width) & (y >= 0) & (y < height)
        rows = np.flatnonzero(claim)
        pixel = y[rows] * width + x[rows]
        nearer = away[rows] < distance[pixel]
        pixel, rows = pixel[nearer], rows[nearer]
        owner[pixel] = visible[rows]
        distance[pixel] = away[rows]
    # Row 0 of an image is its top.
    return owner.reshape(height, width)[::-1], distance.reshape(height, width)[::-1] / window.scale


def _patch(
    centre: NDArray[np.int64], size: int, width: int, height: int
) -> tuple[tuple[slice, slice], NDArray[np.int64], NDArray[np.int64]]:
    """Return the part of an image around a pixel as slices, and its columns and rows."""
    x0, x1 = (int(np.clip(centre[0] + s, 0, width)) for s in (-size, size + 1))
    y0, y1 = (int(np.clip(centre[1] + s, 0, height)) for s in (-size, size + 1))
    return (slice(y0, y1), slice(x0, x1)), np.arange(x0, x1), np.arange(y0, y1)


def compose(*layers: tuple[NDArray[np.int64], Colours]) -> Image:
    """Return the RGB image of layers, the first one lowest, shape (height, width, 3).

    Args:
        layers: which particle each pixel shows, shape (height, width), and the colour of each, shape (particles, 3).
    """
    height, width = layers[0][0].shape
    image = np.full((height, width, 3), _WHITE, dtype=np.uint8)
    for owner, colours in layers:
        shown = owner >= 0
        image[shown] = np.asarray(np.clip(colours[owner[shown]] * 255.0 + 0.5, 0, 255), dtype=np.uint8)
    return image


def halve(image: Image) -> Image:
    """Return the image at half the size, each pixel the mean of four: soft edges."""
    height, width = image.shape[0] // 2 * 2, image.shape[1] // 2 * 2
    four = image[:height, :width].astype(np.uint16)
    mean = (four[::2, ::2] + four[1::2, ::2] + four[::2, 1::2] + four[1::2, 1::2] + 2) // 4
    return mean.astype(np.uint8)


@dataclass(frozen=True)
class Camera:
    """A perspective view of a box.

    Args:
        lower, upper: corners of the box to look at [m], shape (3,).
        azimuth, height: direction from which it is seen [degrees]: azimuth −90 looks along +y.
        shape: height and width of the image [pixels].
    """

    lower: NDArray[np.float64]
    upper: NDArray[np.float64]
    azimuth: float
    height: float
    shape: tuple[int, int]

    @property
    def axes(self) -> NDArray[np.float64]:
        """Unit vectors to the right, up, and towards the eye, shape (3, 3)."""
        a, h = np.radians(self.azimuth), np.radians(self.height)
        eye = np.array([np.cos(h) * np.cos(a), np.cos(h) * np.sin(a), np.sin(h)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        return np.array([right, np.cross(eye, right), eye])

    @property
    def distance(self) -> float:
        """Distance of the eye from the middle of the box [m]."""
        return 2.5 * float(np.linalg.norm(self.upper - self.lower))

    @property
    def eye(self) -> NDArray[np.float64]:
        """Where the eye is [m], shape (3,)."""
        place: NDArray[np.float64] = 0.5 * (self.lower + self.upper) + self.distance * self.axes[2]
        return place

    def _raw(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        seen: NDArray[np.float64] = (np.asarray(points, dtype=float) - 0.5 * (self.lower + self.upper)) @ self.axes.T
        depth = self.distance - seen[:, 2]
        return np.column_stack([seen[:, :2] * (self.distance / depth)[:, None], depth])

    def extent(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the corners of the box's picture in the image plane [m]."""
        pick = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T
        corners = self._raw(np.where(pick, self.upper, self.lower))[:, :2]
        return corners.min(axis=0), corners.max(axis=0)

    @property
    def scale(self) -> float:
        """Pixels per metre in the plane through the middle of the box."""
        low, high = self.extent()
        size = np.array([self.shape[1], self.shape[0]])
        return float(np.min(size / (high - low)))

    def project(
        self, points: NDArray[np.floating]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return pixels (x right, y down), depth [m] and magnification of points, shape (rows, 3)."""
        raw = self._raw(points)
        low, high = self.extent()
        middle = 0.5 * (low + high)
        xy = (raw[:, :2] - middle) * self.scale
        xy = np.array([0.5 * self.shape[1], 0.5 * self.shape[0]]) + xy * np.array([1.0, -1.0])
        return xy, raw[:, 2], self.distance / raw[:, 2]


_LIGHT = np.array([-0.35, 0.55, 0.76])  # right, up, towards the eye
_LIGHT = _LIGHT / np.linalg.norm(_LIGHT)


def paint_spheres(
    camera: Camera,
    position: NDArray[np.floating],
    radius: NDArray[np.floating],
    colours: Colours,
    ball: NDArray[np.bool_],
    behind: NDArray[np.floating] | float = 0.0,
) -> Image:
    """Return the RGB image of particles, the nearer before the farther.

    Args:
        camera: the view.
        position: centres [m], shape (rows, 3).
        radius: radii [m], shape (rows,).
        colours: RGB in 0…1, shape (rows, 3).
        ball: which rows are shaded as balls; the others are flat discs, shape (rows,).
        behind: how much farther than it is a row counts [m], scalar or shape (rows,).
    """
    height, width = camera.shape
    xy, depth, magnification = camera.project(position)
    depth = depth + behind
    r = np.maximum(np.rint(radius * camera.scale * magnification), 1.0).astype(np.int64)  # whole pixels
    reach = int(r.max(initial=1))
    ok = np.all((xy > -reach) & (xy < np.array([width, height]) + reach), axis=1)
    # Far to near, so the row number is the depth: the largest number in a pixel is what is seen.
    order = np.argsort(-depth[ok], kind="stable")
    rows = np.flatnonzero(ok)[order]
    r = r[rows]
    wide = width + 4 * reach  # a margin, so that no disc needs to be cut
    centre = np.floor(xy[rows]).astype(np.int64)
    base = (centre[:, 1] + 2 * reach) * wide + centre[:, 0] + 2 * reach
    padded = np.full((height + 4 * reach) * wide, -1, dtype=np.int32)
    few = len(rows) < 3 * reach * reach  # few large balls: one after the other, far to near, is quicker
    for i in range(len(rows) if few else 0):
        disc = np.arange(-r[i], r[i] + 1)
        y, x = np.nonzero(disc[:, None] ** 2 + disc**2 <= r[i] * (r[i] + 0.5))
        padded[base[i] + (y - r[i]) * wide + (x - r[i])] = i
    for size in np.unique(r) if not few else ():
        number = np.flatnonzero(r == size).astype(np.int32)
        start = base[number]
        for i in range(-size, size + 1):
            for j in range(-size, size + 1):
                if i * i + j * j > size * size + 0.5 * size:
                    continue
                pixel = start + (j * wide + i)
                # Assignment keeps the last of equal indices, which is the nearest; then compare.
                before = padded[pixel]
                padded[pixel] = number
                padded[pixel] = np.maximum(padded[pixel], before)
    front = padded.reshape(-1, wide)[2 * reach : -2 * reach, 2 * reach : -2 * reach].reshape(-1)
    image = np.full((height * width, 3), 255, dtype=np.uint8)
    seen = np.flatnonzero(front >= 0)
    who = front[seen]
    dx = (seen % width - centre[who, 0]) / r[who]
    dy = (seen // width - centre[who, 1]) / r[who]
    dz = np.sqrt(np.clip(1.0 - dx * dx - dy * dy, 0.0, 1.0))
    light = np.clip(dx * _LIGHT[0] - dy * _LIGHT[1] + dz * _LIGHT[2], 0.0, 1.0)
    row = rows[who]
    brightness = np.where(ball[row], 0.62 + 0.42 * light, 1.0)
    colour = np.clip(colours[row] * brightness[:, None], 0.0, 1.0)
    image[seen] = (colour * 255.0 + 0.5).astype(np.uint8)
    return image.reshape(height, width, 3)
