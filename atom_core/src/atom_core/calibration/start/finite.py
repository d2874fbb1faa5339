"""Residuals that are no numbers: found before the solver, and named."""

from __future__ import annotations

import numpy as np

from atom_core.errors import CalibrationError
from atom_core.problem.residuals import REPROJECTION
from atom_core.solvers.base import Solver


def check_finite(solver: Solver) -> None:
    """Refuse a problem with a residual that is NaN or infinite at the start.

    Raises:
        CalibrationError: naming sensor, collection, pattern and corner or point.
    """
    problem = solver.problem
    squares = solver.squares(np.zeros(problem.parameters.size), problem.initial_sigmas)
    for block, values in zip(problem.residual_blocks, squares):
        bad = np.flatnonzero(~np.isfinite(values))
        if len(bad) == 0:
            continue
        key = problem.detections[block.detection[bad[0]]]
        item = "corner" if block.kind == REPROJECTION else "point"
        more = f" (and {len(bad) - 1} more of this sensor)" if len(bad) > 1 else ""
        raise CalibrationError(
            f"sensor '{key.sensor}', collection {key.collection}, pattern '{key.pattern}': the "
            f"{block.kind} residual of {item} {block.ids[bad[0]]} is not finite{more}; correct the "
            f"label or the transforms, or leave the collection out with -csf '!{key.collection}'"
        )
