"""Results of a run: frames, gauges, log, summary, comparison and pictures.

Outputs look at the state and write; they never change it.
"""

from __future__ import annotations

from typing import Any

from spume.outputs import gauges as gauges  # registers the kinds of gauges
from spume.outputs.gauge import Gauge
from spume.outputs.output import Output, Outputs, OutputSettings, RunLike
from spume.outputs.reference import Reference
from spume.outputs.snapshot import Snapshot

__all__ = [
    "Gauge",
    "Output",
    "OutputSettings",
    "Outputs",
    "Reference",
    "RunLike",
    "Snapshot",
    "outputs_of",
]


def outputs_of(case: Any) -> Outputs:
    """Return all outputs of a case, in the order in which they are told of a step.

    Raises:
        ValueError: two gauges of one name, or a reference of a gauge that is not there.
    """
    from spume.outputs.checkpoint import Checkpoint
    from spume.outputs.frames import Frames
    from spume.outputs.log import Log
    from spume.outputs.pictures import Pictures
    from spume.outputs.record import Gauges
    from spume.outputs.reference import Compare
    from spume.outputs.summary import Summary

    settings: OutputSettings = case.output
    log = Log(settings.log_interval)
    compare = Compare(case.reference, [g.name for g in case.gauge])
    chosen: list[Output] = [Gauges(case.gauge)]
    if settings.frames:
        chosen.append(Frames(settings))
    chosen += [log, compare]
    if settings.pictures:
        chosen.append(Pictures(settings, case.reference))
    # Last, so that it knows what the others found.
    chosen.append(Summary(log, compare))
    return Outputs(chosen, Checkpoint(settings))
