"""What a round of reweighting needs to know of a problem at one vector.

The specification of the native twin (`CalibrationProblem.assess`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import List, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.problem.problem import Linearisation, Problem
from atom_core.problem.residuals import BorderBlock, squared_norms
from atom_core.solvers import losses
from atom_core.solvers.normal_equations import (
    Layout,
    NormalEquations,
    add_prior,
    normal_equations,
)


class InsetColumn(NamedTuple):
    """The derivative of a border block's rows by its inset, in steps of the sampling, reduced.

    Attributes:
        block: index of the residual block.
        across: (n, 2) steps across the sides of x and of y [m].
        by_steps: (n,) the derivative.
        curvature: sum of weight times derivative squared.
        slope: sum of weight times derivative times residual.
        detection: (m,) detections with rows in the block.
        by_twist: (m, 6) what the inset and these detections' twists have in common.
    """

    block: int
    across: np.ndarray
    by_steps: np.ndarray
    curvature: float
    slope: float
    detection: np.ndarray
    by_twist: np.ndarray


@dataclass(frozen=True)
class Assessment:
    """A problem at one vector, one loss and one set of sigmas.

    Attributes:
        equations: the weighted normal equations.
        columns: of the border blocks whose inset the data can tell.
    """

    equations: NormalEquations
    columns: Tuple[InsetColumn, ...]


def assess(
    problem: Problem, layout: Layout, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str
) -> Assessment:
    """Return the assessment of a problem at the vector x."""
    linearisation = problem.linearise(x)
    weights = [
        losses.weight(loss, squared_norms(r, s)) / s**2
        for r, s in zip(linearisation.residuals, sigmas)
    ]
    equations = normal_equations(problem, layout, linearisation, weights)
    add_prior(equations, problem.parameters, x)
    columns = _columns(problem, problem.poses(x), linearisation, weights)
    return Assessment(equations, tuple(columns))


def _columns(
    problem: Problem,
    poses: np.ndarray,
    linearisation: Linearisation,
    weights: Sequence[np.ndarray],
) -> List[InsetColumn]:
    columns = []
    for i, block in enumerate(problem.residual_blocks):
        if not isinstance(block, BorderBlock):
            continue
        by_steps = block.by_inset_steps(poses)
        rows = linearisation.by_state[i][:, 0]
        detection, by_twist = block.sums((weights[i] * by_steps)[:, None] * rows)
        curvature = float(np.sum(weights[i] * by_steps**2))
        slope = float(np.sum(weights[i] * by_steps * linearisation.residuals[i][:, 0]))
        if curvature > 0:
            across = block.steps_across(poses)
            columns.append(InsetColumn(i, across, by_steps, curvature, slope, detection, by_twist))
    return columns
