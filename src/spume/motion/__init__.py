"""Prescribed rigid motions of bodies, and of a whole tank."""

from spume.motion.base import Motion
from spume.motion.composed import Composed
from spume.motion.pose import Pose
from spume.motion.series import Series
from spume.motion.sinusoid import Sinusoid
from spume.motion.uniform import Uniform

__all__ = ["Composed", "Motion", "Pose", "Series", "Sinusoid", "Uniform"]
