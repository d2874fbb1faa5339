"""The reference minimiser: Levenberg-Marquardt with numpy and scipy.linalg.

Analytic Jacobians, board poses eliminated. It is the specification that the native solver is
compared with; ``scipy.optimize.least_squares`` reaches the same optimum (see the tests) but
knows nothing of the blocks, and is several times slower on a problem of this shape.
Damping after Nielsen, "Damping parameter in Marquardt's method" (1999).
"""

from __future__ import annotations

from typing import List, Optional, Sequence, Tuple

import numpy as np

from atom_core.problem.problem import Problem
from atom_core.problem.residuals import squared_norms
from atom_core.solvers import losses
from atom_core.solvers.base import EXACT, Minimum, Tolerance
from atom_core.solvers.normal_equations import Layout, NormalEquations, normal_equations

_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-3, 1e-12, 1e12
_ROUNDING = 1e-13  # relative; a smaller decrease drowns in the rounding of the cost
# The linearisation holds no farther: without this limit a direction that the data hardly see
# can be thrown metres away in the first steps, into another basin.
_LONGEST_STEP_M, _LONGEST_STEP_RAD = 0.5, 0.5


def total_cost(residuals: Sequence[np.ndarray], sigmas: Sequence[np.ndarray], loss: str) -> float:
    """Return half the sum of rho over the items of all residual blocks."""
    return sum(losses.cost(loss, squared_norms(r, s)) for r, s in zip(residuals, sigmas))


def robust_weights(
    residuals: Sequence[np.ndarray], sigmas: Sequence[np.ndarray], loss: str
) -> List[np.ndarray]:
    """Return the robust weight (n,) of every item, for each residual block."""
    return [losses.weight(loss, squared_norms(r, s)) for r, s in zip(residuals, sigmas)]


def equations_at(
    problem: Problem, layout: Layout, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str
) -> NormalEquations:
    """Return the weighted normal equations at the vector x."""
    line = problem.linearise(x)
    weights = [w / s**2 for w, s in zip(robust_weights(line.residuals, sigmas, loss), sigmas)]
    return normal_equations(problem, layout, line, weights)


def minimise(
    problem: Problem,
    x: np.ndarray,
    sigmas: Tuple[np.ndarray, ...],
    loss: str,
    max_iterations: int,
    tolerance: Tolerance = EXACT,
) -> Minimum:
    """Minimise the cost from x; the result is never worse than the start.

    Args:
        problem: what to minimise.
        x: (p,) where to start.
        sigmas: for each residual block, (n,) in its unit.
        loss: none, huber or cauchy.
        max_iterations: steps to try.
        tolerance: when it is enough.
    """
    layout = Layout(problem.parameters)
    cost = total_cost(problem.residuals(x), sigmas, loss)
    if not np.isfinite(cost):
        return Minimum(x, cost, 0, False, "the cost is not finite at the start")
    damping, growth, slow = _FIRST_DAMPING, 2.0, 0
    equations = equations_at(problem, layout, x, sigmas, loss)
    for iteration in range(max_iterations):
        enough = tolerance.decrease * _unit_cost(problem, cost)
        if slow == 2 or _newton_decrease(equations) < enough:
            return Minimum(x, cost, iteration, True, "a further step would change nothing")
        step, predicted = _try_solve(equations, damping)
        gain, trial, trial_cost = -1.0, x, cost
        if step is not None and _within_reach(step):
            trial = x + step
            trial_cost = total_cost(problem.residuals(trial), sigmas, loss)
            gain = (cost - trial_cost) / predicted
        if not trial_cost < cost:
            if predicted < _ROUNDING * cost:
                return Minimum(x, cost, iteration, True, "no step lowers the cost any more")
            damping, growth = damping * growth, growth * 2.0
            if damping > _MOST_DAMPING:
                return Minimum(x, cost, iteration, False, "no step lowers the cost")
            continue
        slow = slow + 1 if cost - trial_cost < tolerance.relative * cost else 0
        x, cost, growth = trial, trial_cost, 2.0
        damping = max(damping * max(1.0 / 3.0, 1.0 - (2.0 * gain - 1.0) ** 3), _LEAST_DAMPING)
        equations = equations_at(problem, layout, x, sigmas, loss)
    return Minimum(x, cost, max_iterations, False, f"not done after {max_iterations} iterations")


def _unit_cost(problem: Problem, cost: float) -> float:
    """Return the mean squared residual where it exceeds one: sigmas may be far off."""
    return max(1.0, 2.0 * cost / max(problem.row_count, 1))


def _within_reach(step: np.ndarray) -> bool:
    blocks = step.reshape(-1, 6)
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


def _newton_decrease(equations: NormalEquations) -> float:
    """Return how much an undamped step would lower the cost; infinite where it cannot be told."""
    for damping in (0.0, 1e-12, 1e-9):
        step, predicted = _try_solve(equations, damping)
        if step is not None and np.isfinite(predicted):
            return abs(predicted)
    return np.inf
