"""What errors that sensors and boards usually have, and that the data do not exclude, may do.

An error that is too small to be seen is in no residual, in no check, and the same in all
collections. Every one that the checks look for is taken as a further number, expected near zero
with what is usual as its standard deviation. The data tell more of it, or less: what they leave
open is carried to the poses, and so is what the poses would move by if it were estimated (the mean
squared error of an estimate that leaves these numbers at zero; JCGM 100, combined standard
uncertainty).
"""

from __future__ import annotations

from typing import Mapping

import numpy as np

from atom_core.problem.blocks import BLOCK_SIZE
from atom_core.problem.model_errors import ModelError, SeenBorder
from atom_core.solvers import losses
from atom_core.solvers.error_columns import prior_information
from atom_core.solvers.shared_equations import SharedEquations, inverse


def usual_errors_covariance(
    equations: SharedEquations, usual: Mapping[ModelError, float], loss: str
) -> np.ndarray:
    """Return (6 s, 6 s): what the shared blocks may be off by usual errors, as a covariance.

    Args:
        equations: at the solution, with all errors that sensors and boards may have.
        usual: standard deviations of those that the solution has not estimated, in their units.
        loss: robust loss of the equations.
    """
    place = dict(enumerate(equations.errors, equations.shared))
    nuisances = {e for e in equations.errors if isinstance(e, SeenBorder)}
    estimated = (j for j, e in place.items() if e not in usual and e not in nuisances)
    base = [*range(equations.shared), *estimated]
    rest = [j for j, e in place.items() if e in usual and e not in nuisances]
    total = equations.total
    gradient = equations.gradient.sum(axis=0) + equations.held_gradient
    cross = total[np.ix_(base, rest)]
    gains = inverse(total[np.ix_(base, base)]) @ cross
    information = total[np.ix_(rest, rest)] - cross.T @ gains
    information += np.diag([prior_information(place[j], usual) for j in rest])
    left_open = inverse(information)
    step = -left_open @ (gradient[rest] - gains.T @ gradient[base])
    step *= losses.step_length(loss)  # what is far off counts less, and the step falls short
    gains = gains[: BLOCK_SIZE * equations.blocks]
    return gains @ (left_open + np.outer(step, step)) @ gains.T
