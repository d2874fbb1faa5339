"""The reference minimiser: Levenberg-Marquardt with numpy and scipy.linalg.

Analytic Jacobians, board poses eliminated. It is the specification that the native solver is
compared with; ``scipy.optimize.least_squares`` reaches the same optimum (see the tests) but
knows nothing of the blocks, and is several times slower on a problem of this shape.
Damping after Nielsen, "Damping parameter in Marquardt's method" (1999).
"""

from __future__ import annotations

from typing import Iterator, List, Optional, Sequence, Tuple

import numpy as np

from atom_core.problem.blocks import ROTATION, TRANSLATION
from atom_core.problem.problem import Problem
from atom_core.problem.residuals import squared_norms
from atom_core.solvers import losses
from atom_core.solvers.assessment import Assessment, assess
from atom_core.solvers.base import Minimum, RoundProgress
from atom_core.solvers.criteria import (
    ENOUGH,
    EXACT,
    ROUNDING,
    Tolerance,
    relative_length,
    unit_cost,
)
from atom_core.solvers.normal_equations import Layout, NormalEquations

_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-3, 1e-12, 1e12


class LevenbergMarquardt:
    """Minimises one problem; see `Solver` for the contract."""

    def __init__(self, problem: Problem):
        """Lay out the problem."""
        self.problem = problem
        self._layout = Layout(problem.parameters)

    def take_insets(self, problem: Problem) -> None:
        """Go on with a problem that differs from the present one in its insets only."""
        self.problem = problem

    def take_rows(self, problem: Problem) -> None:
        """Go on with a problem that differs from the present one in its model errors only."""
        self.problem = problem

    def equations(self, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str) -> NormalEquations:
        """Return the weighted normal equations at the vector x."""
        return self.assess(x, sigmas, loss).equations

    def assess(self, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str) -> Assessment:
        """Return the equations at x, and how the border rows depend on their insets."""
        return assess(self.problem, self._layout, x, sigmas, loss)

    def linearised_blocks(
        self, x: np.ndarray, poses: np.ndarray
    ) -> Iterator[Tuple[np.ndarray, np.ndarray]]:
        """Yield residuals and derivatives by state of one block after the other, at x."""
        return self.problem.linearised_blocks(x, poses)

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
                return Minimum.interrupted_at(x, cost, iteration)
            promised = equations.newton_decrease()
            if slow == 2 or promised < tolerance.decrease * unit_cost(self.problem, cost):
                return Minimum(x, cost, iteration, True, ENOUGH)
            step, predicted = _try_solve(equations, damping)
            gain, trial, trial_cost = -1.0, x, cost
            if step is not None:
                step = self._cut(losses.step_length(loss) * step)
            if step is not None and self._is_short(step):
                trial = x + step
                trial_cost = self._cost(trial, sigmas, loss)
                gain = (cost - trial_cost) / max(predicted, ROUNDING * cost)
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
        parameters = self.problem.parameters
        blocks = parameters.by_block(step)
        length = _relative_lengths(blocks)
        cut = parameters.is_board_of_collection & (length >= 1.0)
        # just inside, so that rounding does not put it out of reach
        share = np.where(cut, (1.0 - 1e-9) / np.maximum(length, 1), 1)
        return (share[:, None] * blocks).ravel()

    def _is_short(self, step: np.ndarray) -> bool:
        """Tell whether the linearisation holds as far as all poses and joints move."""
        parameters = self.problem.parameters
        moving = parameters.by_block(step)[parameters.is_transform]
        return bool(np.all(_relative_lengths(moving) < 1.0))

    def _cost(self, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str) -> float:
        prior = self.problem.parameters.prior_cost(x)
        return losses.total_cost(loss, self.squares(x, sigmas)) + prior


def _relative_lengths(steps: np.ndarray) -> np.ndarray:
    """Return how long steps (b, 6) are, in parts of the longest that is allowed."""
    return relative_length(*(np.linalg.norm(steps[:, p], axis=1) for p in (ROTATION, TRANSLATION)))


def _try_solve(equations: NormalEquations, damping: float) -> Tuple[Optional[np.ndarray], float]:
    try:
        return equations.solve(damping)
    except np.linalg.LinAlgError:
        return None, np.inf
