"""The inverse of ``spume.report.packed``, once more in NumPy; the page has its own in JavaScript."""

import base64
import zlib

import numpy as np


def unpacked(channel, rows, text):
    """Values of a channel, shape (frames, rows)."""
    data = np.frombuffer(zlib.decompress(base64.b64decode(text)), dtype=np.uint8)
    count, begin = channel["frames"] * rows, channel["offset"]
    stored = data[begin : begin + count].astype(np.int64) + 256 * data[begin + count : begin + 2 * count].astype(
        np.int64
    )
    difference = np.where(stored & 1, -(stored >> 1) - 1, stored >> 1).reshape(channel["frames"], rows)
    codes = np.zeros((channel["frames"], rows), dtype=np.int64)
    for f in range(channel["frames"]):
        if f >= 2 and channel["order"] == 2:
            guess = 2 * codes[f - 1] - codes[f - 2]
        else:
            guess = codes[f - 1] if f else 0
        codes[f] = (guess + difference[f]) % 65536
    return channel["low"] + channel["step"] * codes
