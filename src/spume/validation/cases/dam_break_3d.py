"""Case 6b in 3D, reported."""

from spume.validation.cases.dam_break import of

STUDY = of("dam-break-3d", "6c", (10, 20, 30), (), judged=False)
