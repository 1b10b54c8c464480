"""Bodies: everything that is not fluid."""

from spume.bodies.base import Body
from spume.bodies.rigid import Rigid
from spume.bodies.wall import Wall

__all__ = ["Body", "Rigid", "Wall"]
