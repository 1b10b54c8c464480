"""Case 1 in 3D."""

from spume.validation.cases.hydrostatic import of

STUDY = of("hydrostatic-3d", "1b", 0.25, (10, 20, 40), (6,), 0.03)
