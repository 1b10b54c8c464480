"""Validation: cases with a reference, what is measured of them, and the bars that they should hold.

A case is one file in `spume.validation.cases`, found by its name; `driver` runs, `report` writes.
"""

from spume.validation.folder import Folder
from spume.validation.study import Bar, Curve, Measured, Panel, Run, Study, studies

__all__ = ["Bar", "Curve", "Folder", "Measured", "Panel", "Run", "Study", "studies"]
