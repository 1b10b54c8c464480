"""The kinds of gauges; importing this package registers them."""

from spume.outputs.gauges.budget import Energy, Momentum, Volume
from spume.outputs.gauges.elevation import Elevation
from spume.outputs.gauges.force import Force
from spume.outputs.gauges.front import Front
from spume.outputs.gauges.pressure import Pressure
from spume.outputs.gauges.velocity import Velocity

__all__ = ["Elevation", "Energy", "Force", "Front", "Momentum", "Pressure", "Velocity", "Volume"]
