"""Numbers of many rows in many frames as few bytes: rounded, predicted from the frames before, compressed.

The page's script (``view.js``, ``decoded``) is the inverse.
"""

from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

_CODES = 65535  # largest code


@dataclass
class Packed:
    """Channels of numbers, one after the other in one stream.

    A channel is an array, shape (frames, rows), of codes of 16 bits: value = low + step code. A code is stored as
    its difference (modulo 2^16) from the code of the frame before (order 1) or from the straight line through the
    two frames before (order 2), the sign in the lowest bit; first the low bytes of all differences, then the high
    ones. A channel that does not change is stored as one frame.

    Attributes:
        parts: the bytes of the channels, in order.
        size: bytes until now.
    """

    parts: list[bytes] = field(default_factory=list)
    size: int = 0

    def add(self, values: NDArray[Any], step: float, low: float | None = None) -> dict[str, Any]:
        """Append a channel and return what the reader needs to know of it.

        Args:
            values: shape (frames, rows); all finite.
            step: wanted distance of two codes; it grows where 65 536 codes would not reach.
            low: value of the code 0; default: the smallest value.
        """
        values = np.asarray(values, dtype=np.float64)
        base = float(values.min()) if low is None and values.size else float(low or 0.0)
        range_ = float(values.max()) - base if values.size else 0.0
        step = max(step, range_ / _CODES)
        codes = np.rint((values - base) / step).clip(0, _CODES).astype(np.uint16)
        if len(codes) > 1 and np.all(codes == codes[0]):
            codes = codes[:1]
        order, signed = _predicted(codes)
        stored = ((signed.astype(np.int32) << 1) ^ (signed.astype(np.int32) >> 15)).astype(np.uint16)
        planes = [(stored & 0xFF).astype(np.uint8).tobytes(), (stored >> 8).astype(np.uint8).tobytes()]
        known = {"offset": self.size, "frames": len(codes), "step": step, "low": base, "order": order}
        self.parts += planes
        self.size += sum(map(len, planes))
        return known

    def text(self) -> str:
        """Return all channels, compressed, as text."""
        packer = zlib.compressobj(6)
        data = b"".join([*(packer.compress(part) for part in self.parts), packer.flush()])
        return base64.b64encode(data).decode("ascii")


def _predicted(codes: NDArray[np.uint16]) -> tuple[int, NDArray[np.int16]]:
    """Return the order of prediction that leaves the smaller differences, and the differences."""
    first = np.diff(codes, axis=0, prepend=np.zeros_like(codes[:1])).astype(np.uint16)
    if len(codes) < 3:
        return 1, first.view(np.int16)
    second = first.copy()
    second[2:] = first[2:] - first[1:-1]
    costs = [float(np.log2(1.0 + np.abs(d[2:].view(np.int16).astype(np.float32))).mean()) for d in (first, second)]
    return (1, first.view(np.int16)) if costs[0] <= costs[1] else (2, second.view(np.int16))


def bytes_text(data: bytes) -> str:
    """Return bytes, compressed, as text."""
    return base64.b64encode(zlib.compress(data, 9)).decode("ascii")
