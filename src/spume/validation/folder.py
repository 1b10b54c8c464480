"""The folder of a finished run, as a validation case reads it."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from spume.outputs import summary
from spume.outputs.log import FILE as LOG
from spume.outputs.record import path as gauge_path
from spume.tables import read_columns

if TYPE_CHECKING:
    from spume.case import Case
    from spume.outputs.vtkhdf import Frame

Columns = dict[str, NDArray[np.float64]]


class Folder:
    """Gauges, log, frames and summary of a run.

    Args:
        path: the run folder.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    @cached_property
    def case(self) -> Case:
        """The case that was run."""
        from spume.case import load

        return load(self.path / "case.toml")

    @cached_property
    def summary(self) -> dict[str, Any]:
        """The numbers of ``summary.json``."""
        return summary.read(self.path)

    @cached_property
    def log(self) -> Columns:
        """The columns of ``log.csv``."""
        return read_columns(self.path / LOG)[0]

    def gauge(self, name: str) -> Columns:
        """Return the columns of a gauge."""
        return read_columns(gauge_path(self.path, name))[0]

    def frames(self) -> Iterator[Frame]:
        """Yield the frames; their arrays hold fluid rows only."""
        from dataclasses import replace

        from spume.outputs.snapshot import FLUID
        from spume.outputs.vtkhdf import Reader

        with Reader(self.path / "run.vtkhdf") as reader:
            for index in range(len(reader)):
                frame = reader.read(index)
                fluid = np.asarray(frame["kind"]) == FLUID
                yield replace(frame, arrays={name: values[fluid] for name, values in frame.arrays.items()})

    def last(self) -> Frame:
        """Return the last frame; its arrays hold fluid rows only."""
        *_, frame = self.frames()
        return frame


def budgets(folder: Folder) -> dict[str, float]:
    """Return how volume, energy and momentum of a run changed.

    The volume's largest change is relative to the first step. The mechanical energy's largest gain and last change are
    relative to the largest kinetic energy; they say nothing where something moves the fluid or gravity is not uniform.
    The momentum's largest change is relative to sqrt(2 m E_kin); it is given where the case has a momentum gauge.
    """
    log = folder.log
    if len(log["volume"]) == 0:  # shorter than the interval of the log
        return {}
    volume, kinetic = log["volume"], log["kinetic_energy"]
    energy = kinetic + log["potential_energy"]
    scale = float(kinetic.max()) or 1.0
    found = {
        "volume, largest change": float(np.abs(volume / volume[0] - 1.0).max()),
        "volume, last change": float(volume[-1] / volume[0] - 1.0),
        "energy, largest gain / largest kinetic": float((energy - energy[0]).max() / scale),
        "energy, last change / largest kinetic": float((energy[-1] - energy[0]) / scale),
    }
    momenta = [gauge.name for gauge in folder.case.gauge if gauge.key == "momentum"]
    if momenta:
        columns = folder.gauge(momenta[0])
        momentum = np.column_stack([v for name, v in columns.items() if name != "time"])
        mass = folder.case.fluid[0].density * log["particles_fluid"][0] * folder.case.spacing**folder.case.dimension
        change = np.linalg.norm(momentum - momentum[0], axis=1).max()
        found["momentum, largest change / sqrt(2 m E)"] = float(change / np.sqrt(2.0 * mass * scale))
    return found
