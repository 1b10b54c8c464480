"""The region that rows may be in: the domain's, or one that is large enough."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from spume.case import AXES, CaseError
from spume.moving import reached
from spume.problems import point_text

if TYPE_CHECKING:
    from spume.case import Case

Rows = dict[str, NDArray[Any]]


def region(case: Case, rows: Rows) -> tuple[list[float], list[float]]:
    """Return the corners [m] of the region beyond which particles are removed.

    The domain's, or by default the box around all rows, wherever motions take them, with as much again on
    every side.
    """
    if case.domain.lower is not None and case.domain.upper is not None:
        _check_region(case, rows)
        return list(case.domain.lower), list(case.domain.upper)
    lower, upper = reached(case, rows["position"].min(axis=0), rows["position"].max(axis=0))
    margin = float((upper - lower).max()) + 10.0 * case.spacing
    return list(lower - margin), list(upper + margin)


def _check_region(case: Case, rows: Rows) -> None:
    """Refuse a domain that ends inside a body or a fluid, whose rows beyond it would be removed at once."""
    lower, upper = np.array(case.domain.lower), np.array(case.domain.upper)
    periodic = np.array([axis in case.domain.periodic for axis in AXES[: case.dimension]])
    position = rows["position"]
    beyond = np.any(((position < lower) | (position > upper)) & ~periodic, axis=1)
    if not beyond.any():
        return
    owners = rows["body"][beyond]
    names = [body.name for index, body in enumerate(case.body) if index in owners]
    names += [f"the fluid {f.name}" for m, f in enumerate(case.fluid) if m in rows["material"][beyond][owners < 0]]
    low, high = position.min(axis=0), position.max(axis=0)
    raise CaseError(
        [
            case.problem(
                ("domain", "lower"),
                f"and upper leave out {int(beyond.sum())} of {len(position)} rows, of {', '.join(names)}: walls are "
                f"layers thick, all rows lie in {point_text(low)} … {point_text(high)} m; leave lower and upper out "
                "or put them farther away",
            )
        ]
    )
