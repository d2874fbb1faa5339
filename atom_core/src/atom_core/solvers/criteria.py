"""When a minimiser has done enough, and how far one of its steps may go: the same for all."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from atom_core.problem.problem import Problem

ROUNDING = 1e-13  # relative to the cost; near it the cost cannot tell steps apart any more
SMALLEST_UNIT = 0.1  # squared sigmas, for data without any noise
ENOUGH = "a further step would change nothing"
# The linearisation holds no farther: without this limit a direction that the data hardly see
# can be thrown metres away in the first steps, into another basin.
LONGEST_TURN_RAD, LONGEST_MOVE_M = 0.5, 0.5


class Tolerance(NamedTuple):
    """When a minimiser has done enough.

    Attributes:
        decrease: what a Newton step would lower the cost by at most, in squared sigmas.
        relative: or what two steps in a row lowered the cost by at most, relative to it.
    """

    decrease: float
    relative: float


# EXACT moves no parameter by more than 1e-5 of its standard deviation any more. ROUGH, by a
# tenth, is enough while weights or boards are still to change; it does not follow a valley that
# the data hardly see, which in a wrong basin may lead metres away.
EXACT, ROUGH = Tolerance(1e-11, 0.0), Tolerance(1e-2, 1e-3)
SETTLING = Tolerance(1e-5, 0.0)  # in between: while the last digits of the weights settle


def unit_cost(problem: Problem, cost: float) -> float:
    """Return the mean squared residual: what one squared sigma really is, if sigmas are off."""
    return max(2.0 * cost / max(problem.row_count, 1), SMALLEST_UNIT)


def relative_length(turn_rad: np.ndarray, move_m: np.ndarray) -> np.ndarray:
    """Return how long steps are, in parts of the longest that is allowed."""
    return np.maximum(turn_rad / LONGEST_TURN_RAD, move_m / LONGEST_MOVE_M)
