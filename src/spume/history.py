"""What gauges measure while a simulation is advanced from Python, kept in memory."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from spume.outputs.gauge import Gauge

if TYPE_CHECKING:
    import pandas as pd

    from spume.outputs.output import SimulationLike


class History(Mapping[str, "pd.DataFrame"]):
    """Gauges over time as pandas frames, filled by ``simulation.run(every=…, callback=history)``.

    ``history["toe"]`` has the column ``time`` [s] and one per quantity, in SI units; its ``attrs["units"]`` says
    which, as the gauges of ``spume.open`` do.

    Args:
        gauges: what is measured at each call: ``case.gauge``, or gauges made for it.

    Raises:
        ValueError: at the first call, a gauge that does not fit the simulation; two gauges of one name.
    """

    def __init__(self, gauges: Sequence[Gauge]) -> None:
        self.gauges = {gauge.name: gauge for gauge in gauges}
        if len(self.gauges) < len(gauges):
            raise ValueError(f"gauges need different names: {', '.join(gauge.name for gauge in gauges)}")
        self._rows: dict[str, list[dict[str, float]]] = {name: [] for name in self.gauges}
        self._units: dict[str, dict[str, str]] = {}

    def __call__(self, simulation: SimulationLike) -> None:
        """Measure the present state."""
        snapshot = simulation.snapshot()
        for name, gauge in self.gauges.items():
            if not self._rows[name]:
                gauge.check(snapshot)
                self._units[name] = {"time": "s", **gauge.columns(snapshot.dimension)}
            self._rows[name].append({"time": snapshot.time, **gauge.measure(snapshot)})

    def __getitem__(self, name: str) -> pd.DataFrame:
        """Return a gauge's values so far.

        Raises:
            KeyError: no such gauge.
            ModuleNotFoundError: pandas is missing.
        """
        from spume.results import _pandas

        if name not in self.gauges:
            raise KeyError(f"no gauge {name!r}; there are {', '.join(self.gauges) or 'none'}")
        table: Any = _pandas().DataFrame(self._rows[name], columns=list(self._units.get(name, {"time": "s"})))
        table.attrs["units"] = self._units.get(name, {"time": "s"})
        return table

    def __iter__(self) -> Iterator[str]:
        return iter(self.gauges)

    def __len__(self) -> int:
        return len(self.gauges)
