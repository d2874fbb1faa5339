"""How far inside the border range sensors see it: one number for each, estimated with the poses.

The last sample before a border lies inside it by up to one step of the sampling, half of one on
average; what a labeler adds or takes is in it too. The steps across the border are known, their
share is the unknown. It is not one of the solver's parameters: in each round of reweighting it
takes the Newton step of the joint problem, in which the poses follow (their Schur complement).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Dict, List, NamedTuple, Sequence

import numpy as np

from atom_core.problem.problem import Problem
from atom_core.problem.residuals import BorderBlock, squared_norms
from atom_core.solvers import losses
from atom_core.solvers.base import Solver
from atom_core.solvers.normal_equations import NormalEquations, pulled_back

_MOST_STEPS = 1.0


class _Column(NamedTuple):
    """The derivative of a border block's rows by its inset, reduced.

    Attributes:
        block: index of the residual block.
        across: (n,) steps across the border [m].
        curvature: sum of weight times across squared.
        slope: sum of weight times across times residual.
        by_twist: (d, 6) what the inset and the detections' twists have in common.
    """

    block: int
    across: np.ndarray
    curvature: float
    slope: float
    by_twist: np.ndarray


def update_insets(
    solver: Solver, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str, steps: np.ndarray
) -> np.ndarray:
    """Move the insets of a solver's problem by one Newton step.

    Args:
        solver: whose problem; it goes on with the new insets.
        x: the vector, at or near the minimum for the present insets.
        sigmas: for each residual block, (n,).
        loss: of the solver's rounds.
        steps: (b,) present insets by residual block, in steps of the sampling.

    Returns:
        (b,) new insets; 0 for blocks of other kinds.
    """
    columns = _columns(solver.problem, x, sigmas, loss)
    if not columns:
        return steps
    equations = solver.equations(x, sigmas, loss)
    new = steps.copy()
    chosen = [c.block for c in columns]
    change = losses.step_length(loss) * _newton_step(solver, equations, columns)
    new[chosen] = np.clip(steps[chosen] + change, 0.0, _MOST_STEPS)
    insets: Dict[int, np.ndarray] = {c.block: new[c.block] * c.across for c in columns}
    solver.take_insets(solver.problem.with_insets(insets))
    return new


def _columns(
    problem: Problem, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str
) -> List[_Column]:
    poses = problem.poses(x)
    columns = []
    for i, (block, sigma) in enumerate(zip(problem.residual_blocks, sigmas)):
        if not isinstance(block, BorderBlock):
            continue
        _, across = block.steps_across(poses)
        residual, jacobian = block.linearise(poses)
        weight = losses.weight(loss, squared_norms(residual, sigma)) / sigma**2
        by_twist = np.zeros((len(poses), 6))
        np.add.at(by_twist, block.detection, (weight * across)[:, None] * jacobian[:, 0])
        curvature = float(np.sum(weight * across**2))
        slope = float(np.sum(weight * across * residual[:, 0]))
        if curvature > 0:
            columns.append(_Column(i, across, curvature, slope, by_twist))
    return columns


def _newton_step(
    solver: Solver, equations: NormalEquations, columns: Sequence[_Column]
) -> np.ndarray:
    """Return the change of the insets that lowers the cost most while the poses follow."""
    vectors = [pulled_back(solver.problem, equations.layout, equations.maps, c.by_twist)
               for c in columns]  # fmt: skip
    flat = np.array([equations.layout.join(*v) for v in vectors])
    solved = np.array(
        [-_solve(replace(equations, gradient_shared=s, gradient_local=g)) for s, g in vectors]
    )
    gradient = equations.layout.join(equations.gradient_shared, equations.gradient_local)
    curvature = np.diag([c.curvature for c in columns]) - flat @ solved.T
    slope = np.array([c.slope for c in columns]) - solved @ gradient
    scale = np.sqrt([c.curvature for c in columns])
    # Where the poses can imitate an inset entirely, least squares leaves it as it is.
    step, *_ = np.linalg.lstsq(curvature / scale[:, None] / scale, slope / scale, rcond=1e-6)
    return -step / scale


def _solve(equations: NormalEquations) -> np.ndarray:
    for damping in (0.0, 1e-12, 1e-9, 1e-6):
        try:
            return equations.solve(damping)[0]
        except np.linalg.LinAlgError:
            continue
    return np.zeros(equations.gradient_shared.size + equations.gradient_local.size)
