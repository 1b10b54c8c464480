"""Bodies: everything that is not fluid."""

from spume.bodies.base import Body
from spume.bodies.wall import Wall

__all__ = ["Body", "Wall"]
