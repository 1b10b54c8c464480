"""Case 7a in 3D: what the width of the tank does to an impact."""

from spume.validation.cases.sloshing import of

STUDY = of("sloshing-3d", "7f", (9, 15, 21), ())
