"""How far inside the border range sensors see it: one number for each, estimated with the poses.

The last sample before a border lies inside it by up to one step of the sampling, half of one on
average; what a labeler adds or takes is in it too. The steps across the border are known, their
share is the unknown. It is not one of the solver's parameters: in each round of reweighting it
takes the Newton step of the joint problem (``scalars.py``).
"""

from __future__ import annotations

from typing import Sequence

import numpy as np

from atom_core.solvers.assessment import InsetColumn
from atom_core.solvers.base import Solver

MOST_STEPS = 1.0


def apply_insets(solver: Solver, columns: Sequence[InsetColumn], steps: np.ndarray) -> None:
    """Let a solver go on with other insets.

    Args:
        solver: whose problem.
        columns: of the last assessment, with the steps across the border.
        steps: (b,) insets by residual block, in steps of the sampling.
    """
    if columns:
        insets = {c.block: steps[c.block] * c.across for c in columns}
        solver.take_insets(solver.problem.with_insets(insets))
