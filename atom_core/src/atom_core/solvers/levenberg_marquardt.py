"""The reference minimiser: Levenberg-Marquardt with numpy and scipy.linalg.

Analytic Jacobians, board poses eliminated. It is the specification that the native solver is
compared with; ``scipy.optimize.least_squares`` reaches the same optimum (see the tests) but
knows nothing of the blocks, and is several times slower on a problem of this shape.
Damping after Nielsen, "Damping parameter in Marquardt's method" (1999).
"""

from __future__ import annotations

from typing import List, Optional, Sequence, Tuple

import numpy as np

from atom_core.problem.parameters import PATTERN
from atom_core.problem.problem import Problem
from atom_core.problem.residuals import squared_norms
from atom_core.solvers import losses
from atom_core.solvers.assessment import Assessment, assess
from atom_core.solvers.base import EXACT, Minimum, RoundProgress, Tolerance
from atom_core.solvers.normal_equations import Layout, NormalEquations

_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-3, 1e-12, 1e12
ROUNDING = 1e-13  # relative to the cost; near it the cost cannot tell steps apart any more
_SMALLEST_UNIT = 0.1  # for data without any noise
ENOUGH = "a further step would change nothing"
# The linearisation holds no farther: without this limit a direction that the data hardly see
# can be thrown metres away in the first steps, into another basin.
_LONGEST_STEP_M, _LONGEST_STEP_RAD = 0.5, 0.5
_TURN_AND_MOVE = slice(0, 3), slice(3, 6)


def total_cost(squares: Sequence[np.ndarray], loss: str) -> float:
    """Return half the sum of rho over the squared norms (n,) of all residual blocks."""
    return sum(losses.cost(loss, square) for square in squares)


def interrupted_at(x: np.ndarray, cost: float, iterations: int) -> Minimum:
    """Return the best state of a minimiser that was stopped."""
    return Minimum(x, cost, iterations, False, "interrupted", interrupted=True)


class LevenbergMarquardt:
    """Minimises one problem; see `Solver` for the contract."""

    def __init__(self, problem: Problem):
        """Lay out the problem."""
        self.problem = problem
        self._layout = Layout(problem.parameters)
        blocks = problem.parameters.blocks
        self._is_board = np.array(
            [b.kind == PATTERN and b.collection is not None for b in blocks], dtype=bool
        )
        self._poses = problem.parameters.local_start == 0  # blocks that move something

    def take_insets(self, problem: Problem) -> None:
        """Go on with a problem that differs from the present one in its insets only."""
        self.problem = problem

    def take_range_offsets(self, problem: Problem) -> None:
        """Go on with a problem that differs from the present one in its range offsets only."""
        self.problem = problem

    def equations(self, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str) -> NormalEquations:
        """Return the weighted normal equations at the vector x."""
        return self.assess(x, sigmas, loss).equations

    def assess(self, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str) -> Assessment:
        """Return the equations at x, and how the border rows depend on their insets."""
        return assess(self.problem, self._layout, x, sigmas, loss)

    def squares(self, x: np.ndarray, sigmas: Sequence[np.ndarray]) -> List[np.ndarray]:
        """Return, for each residual block, squared norms (n,) at x in units of sigma."""
        return [squared_norms(r, s) for r, s in zip(self.problem.residuals(x), sigmas)]

    def minimise(
        self,
        x: np.ndarray,
        sigmas: Sequence[np.ndarray],
        loss: str,
        max_iterations: int,
        tolerance: Tolerance = EXACT,
        progress: Optional[RoundProgress] = None,
    ) -> Minimum:
        """Minimise the cost from x; the result is never worse than the start."""
        cost = self._cost(x, sigmas, loss)
        if not np.isfinite(cost):
            return Minimum(x, cost, 0, False, "the cost is not finite at the start")
        damping, growth, slow = _FIRST_DAMPING, 2.0, 0
        equations = self.equations(x, sigmas, loss)
        for iteration in range(max_iterations):
            if progress is not None and progress(iteration, cost, x) is False:
                return interrupted_at(x, cost, iteration)
            promised = equations.newton_decrease()
            if slow == 2 or promised < tolerance.decrease * unit_cost(self.problem, cost):
                return Minimum(x, cost, iteration, True, ENOUGH)
            step, predicted = _try_solve(equations, damping)
            gain, trial, trial_cost = -1.0, x, cost
            if step is not None:
                step = self._cut(losses.step_length(loss) * step)
            if step is not None and _within_reach(step, self._poses):
                trial = x + step
                trial_cost = self._cost(trial, sigmas, loss)
                gain = (cost - trial_cost) / predicted
            if not trial_cost < cost:
                damping, growth = damping * growth, growth * 2.0
                if damping > _MOST_DAMPING:
                    done = promised < ROUNDING * cost
                    return Minimum(x, cost, iteration, done, "no step lowers the cost any more")
                continue
            slow = slow + 1 if cost - trial_cost < tolerance.relative * cost else 0
            x, cost, growth = trial, trial_cost, 2.0
            shrink = max(1.0 / 3.0, 1.0 - (2.0 * gain - 1.0) ** 3)
            damping = max(damping * shrink, _LEAST_DAMPING)
            equations = self.equations(x, sigmas, loss)
        return Minimum(
            x, cost, max_iterations, False, f"not done after {max_iterations} iterations"
        )

    def _cut(self, step: np.ndarray) -> np.ndarray:
        """Shorten the step of each board that wants farther than the linearisation holds.

        It does not hold up all others so, as it would if the whole step were refused.
        """
        blocks = step.reshape(-1, 6)
        turn, move = (np.linalg.norm(blocks[:, part], axis=1) for part in _TURN_AND_MOVE)
        length = np.maximum(turn / _LONGEST_STEP_RAD, move / _LONGEST_STEP_M)
        # just inside, so that rounding does not put it out of reach
        share = np.where(self._is_board & (length >= 1.0), (1.0 - 1e-9) / np.maximum(length, 1), 1)
        return (share[:, None] * blocks).ravel()

    def _cost(self, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str) -> float:
        return total_cost(self.squares(x, sigmas), loss)


def unit_cost(problem: Problem, cost: float) -> float:
    """Return the mean squared residual: what one squared sigma really is, if sigmas are off."""
    return max(2.0 * cost / max(problem.row_count, 1), _SMALLEST_UNIT)


def _within_reach(step: np.ndarray, poses: np.ndarray) -> bool:
    blocks = step.reshape(-1, 6)[poses]
    if blocks.size == 0:
        return True
    turn = np.max(np.linalg.norm(blocks[:, :3], axis=1))
    move = np.max(np.linalg.norm(blocks[:, 3:], axis=1))
    return bool(turn < _LONGEST_STEP_RAD and move < _LONGEST_STEP_M)


def _try_solve(equations: NormalEquations, damping: float) -> Tuple[Optional[np.ndarray], float]:
    try:
        return equations.solve(damping)
    except np.linalg.LinAlgError:
        return None, np.inf
