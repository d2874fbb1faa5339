"""How far inside the border range sensors see it: one number for each, estimated with the poses.

The last sample before a border lies inside it by up to one step of the sampling, half of one on
average; what a labeler adds or takes is in it too. The steps across the border are known, their
share is the unknown. It is not one of the solver's parameters: in each round of reweighting it
takes the Newton step of the joint problem, in which the poses follow (their Schur complement).
"""

from __future__ import annotations

from typing import Optional, Sequence

import numpy as np

from atom_core.problem.problem import Problem
from atom_core.solvers import losses
from atom_core.solvers.assessment import Assessment, InsetColumn
from atom_core.solvers.base import Solver
from atom_core.solvers.normal_equations import Factor, NormalEquations, pulled_back

MOST_STEPS = 1.0


def better_insets(
    problem: Problem, assessment: Assessment, loss: str, steps: np.ndarray
) -> np.ndarray:
    """Return the insets after one Newton step of the joint problem.

    Args:
        problem: with the present insets.
        assessment: of the problem at or near the minimum for them.
        loss: of the rounds.
        steps: (b,) present insets by residual block, in steps of the sampling.

    Returns:
        (b,) new insets; 0 for blocks of other kinds.
    """
    columns = assessment.columns
    if not columns:
        return steps
    new = steps.copy()
    chosen = [c.block for c in columns]
    change = losses.step_length(loss) * _newton_step(problem, assessment.equations, columns)
    new[chosen] = np.clip(steps[chosen] + change, 0.0, MOST_STEPS)
    return new


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


def _newton_step(
    problem: Problem, equations: NormalEquations, columns: Sequence[InsetColumn]
) -> np.ndarray:
    """Return the change of the insets that lowers the cost most while the poses follow."""
    join = equations.layout.join
    vectors = [pulled_back(problem, equations.layout, equations.maps, c.detection,
                           c.by_twist) for c in columns]  # fmt: skip
    flat = np.array([join(*v) for v in vectors])
    factor, solved = _factor(equations), np.zeros_like(flat)
    if factor is not None:
        solved = np.array([join(*factor.solve(*v)) for v in vectors])
    gradient = join(equations.gradient_shared, equations.gradient_local)
    curvature = np.diag([c.curvature for c in columns]) - flat @ solved.T
    slope = np.array([c.slope for c in columns]) - solved @ gradient
    scale = np.sqrt([c.curvature for c in columns])
    # Where the poses can imitate an inset entirely, least squares leaves it as it is.
    step, *_ = np.linalg.lstsq(curvature / scale[:, None] / scale, slope / scale, rcond=1e-6)
    return -step / scale


def _factor(equations: NormalEquations) -> Optional[Factor]:
    for damping in (0.0, 1e-12, 1e-9, 1e-6):
        try:
            return Factor(equations, damping)
        except np.linalg.LinAlgError:
            continue
    return None
