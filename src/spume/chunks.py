"""Storage for the neighbours of many rows: as many arrays as it takes, each for a chunk of whole rows.

One array holds no more than 2^31 numbers, the neighbours of some 40 million rows in 3D. This is the only place that
cuts rows into chunks; whoever walks lists launches a kernel per chunk, and entries of a matrix lie in the same chunks.
"""

from dataclasses import dataclass
from typing import Any

from spume import kernels, lanes

MOST_ENTRIES = kernels.LONGEST_ARRAY
"""Entries of one chunk, at most."""

_ROOM_FOR_MORE = 1.05
"""Rows that there is room for once there is too little, as a multiple of those that are needed."""


@dataclass(frozen=True)
class Chunk:
    """Rows whose neighbours lie in one array.

    Sums of a row stay within its chunk: results do not depend on how many there are. All chunks but the last have the
    same number of rows.

    Attributes:
        begin: first row.
        end: row behind the last.
        neighbour: row numbers, at the slots that the list's ``start`` counts within the chunk.
    """

    begin: int
    end: int
    neighbour: Any


class Storage:
    """Slots for the neighbours of rows: blocks of rows with as many slots each, and chunks of whole blocks.

    Attributes:
        rows_per_block: rows that share a stretch of slots.
        slots_per_block: slots of such a stretch.
        blocks: blocks that there is room for.
    """

    def __init__(self) -> None:
        self.rows_per_block = lanes.GROUP if kernels.runtime().wide else 64
        self.slots_per_block = self.blocks = 0
        self._arrays: list[Any] = []

    @property
    def slots(self) -> int:
        """Slots of all arrays together."""
        return sum(array.shape[0] for array in self._arrays)

    def cut(self, rows: int) -> list[Chunk]:
        """Cut rows into chunks, with room for all their slots; what the arrays held is lost.

        Arrays of the right size stay, so more rows change the last one and add others. Those that do not fit go
        before new ones are made: at no time is there more than before or after.
        """
        if rows > self.blocks * self.rows_per_block or not self._arrays:
            self.blocks = int(_ROOM_FOR_MORE * rows / self.rows_per_block) + 16
        most = max(MOST_ENTRIES // self.slots_per_block, 1)
        sizes = [self.slots_per_block * min(most, self.blocks - b) for b in range(0, self.blocks, most)]
        kept = {k: a for k, (a, size) in enumerate(zip(self._arrays, sizes, strict=False)) if a.shape[0] == size}
        self._arrays = []
        self._arrays = [kept[k] if k in kept else kernels.array(kernels.i32, size) for k, size in enumerate(sizes)]
        size = most * self.rows_per_block
        return [
            Chunk(k * size, min((k + 1) * size, rows), array)
            for k, array in enumerate(self._arrays)
            if k == 0 or k * size < rows
        ]
