"""Scalars that are estimated beside the poses: border insets and model errors.

Together with the poses they make one joint problem. Its normal equations are those of the poses,
bordered by one column for each scalar; the poses are eliminated from them (Schur complement).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional, Sequence, Tuple, Union

import numpy as np

from atom_core.problem.model_errors import ErrorPriors, ModelError
from atom_core.problem.problem import Problem
from atom_core.solvers import losses
from atom_core.solvers.assessment import Assessment, InsetColumn
from atom_core.solvers.error_columns import ErrorColumn, prior_row, within_reason
from atom_core.solvers.insets import MOST_STEPS
from atom_core.solvers.normal_equations import NormalEquations, least_damped, pulled_back
from atom_core.solvers.scalar_columns import Scalars
from atom_core.solvers.shared_equations import summed_columns

Column = Union[InsetColumn, ErrorColumn]


@dataclass(frozen=True)
class JointScalars:
    """The bordered normal equations, reduced to k scalars.

    Attributes:
        errors: which model error each scalar is, None for an inset.
        curvature: (k, k) when the poses follow.
        slope: (k,) when the poses follow.
        gains: (k, p) how the poses follow: minus their change by a scalar.
        scale: (k,) root of the curvature when the poses stay.
    """

    errors: Tuple[Optional[ModelError], ...]
    curvature: np.ndarray
    slope: np.ndarray
    gains: np.ndarray
    scale: np.ndarray

    def newton_step(self) -> np.ndarray:
        """Return the change (k,) that lowers the cost most."""
        scaled = self.curvature / self.scale[:, None] / self.scale
        # Where the poses can imitate a scalar entirely, least squares leaves it as it is.
        step, *_ = np.linalg.lstsq(scaled, self.slope / self.scale, rcond=1e-6)
        return -step / self.scale

    def step_of_poses(self, equations: NormalEquations, scalar_step: np.ndarray) -> np.ndarray:
        """Return the change (p,) of the poses beside a change (k,) of the scalars."""
        layout, step = equations.layout, np.zeros(self.gains.shape[1])
        factor = least_damped(equations)
        if factor is not None:
            right = -equations.gradient_shared, -equations.gradient_local
            step = layout.join(*factor.solve(*right))
        return step - scalar_step @ self.gains

    def covariance(self) -> np.ndarray:
        """Return (k, k); what the poses can imitate entirely gets a huge, finite variance."""
        scaled = self.curvature / self.scale[:, None] / self.scale
        values, vectors = np.linalg.eigh((scaled + scaled.T) / 2.0)
        inverse = (vectors / np.maximum(values, 1e-13)) @ vectors.T
        return inverse / self.scale[:, None] / self.scale


def joint_scalars(
    problem: Problem,
    equations: NormalEquations,
    insets: Sequence[InsetColumn],
    errors: Sequence[ErrorColumn],
    priors: ErrorPriors,
) -> JointScalars:
    """Return the reduced equations of all scalars, insets first.

    Args:
        problem: with the present values of the model errors.
        equations: of the poses.
        insets: the columns of the insets.
        errors: those of the model errors.
        priors: of some errors.
    """
    columns: Tuple[Column, ...] = (*insets, *errors)
    join = equations.layout.join
    vectors = [
        pulled_back(
            problem,
            equations.layout,
            equations.state_jacobians,
            c.detection,
            c.by_twist if isinstance(c, InsetColumn) else c.by_state,
        )
        for c in columns
    ]
    flat = np.array([join(*v) for v in vectors])
    factor, gains = least_damped(equations), np.zeros_like(flat)
    if factor is not None:
        gains = np.array([join(*factor.solve(*v)) for v in vectors])
    gradient = join(equations.gradient_shared, equations.gradient_local)
    alone = np.diag([c.curvature for c in columns])
    for j, error in enumerate(errors, len(insets)):
        for i, column in enumerate(columns[:j]):
            alone[i, j] = alone[j, i] = _common(column, error)
    slope = np.array([c.slope for c in columns]) - gains @ gradient
    for j, error in enumerate(errors, len(insets)):
        value = problem.model_errors.get(error.error, 0.0)
        curvature, by_prior = prior_row(error.error, priors, value)
        alone[j, j] += curvature
        slope[j] += by_prior
    scale = np.sqrt(np.diagonal(alone))
    which = (*(None for _ in insets), *(column.error for column in errors))
    return JointScalars(which, alone - flat @ gains.T, slope, gains, scale)


def joint_of(
    problem: Problem,
    equations: NormalEquations,
    scalars: Scalars,
    shares: Sequence[np.ndarray],
    priors: ErrorPriors,
) -> JointScalars:
    """Return the reduced equations of scalars that are at hand detection by detection.

    Args:
        problem: with the present values of the model errors.
        equations: of the poses, weighted by the shares.
        scalars: the columns.
        shares: for each residual block, (m,) the part of its weight that a detection has.
        priors: of some errors.
    """
    every, join = np.arange(len(problem.detections)), equations.layout.join
    columns = summed_columns(problem, scalars, shares, np.zeros_like(every))
    vectors = [
        pulled_back(problem, equations.layout, equations.state_jacobians, every, by_state)
        for by_state in np.moveaxis(columns.by_state, 2, 0)
    ]
    size = problem.parameters.size
    flat = np.array([join(*v) for v in vectors]).reshape(-1, size)
    factor, gains = least_damped(equations), np.zeros_like(flat)
    if factor is not None:
        gains = np.array([join(*factor.solve(*v)) for v in vectors]).reshape(-1, size)
    gradient = join(equations.gradient_shared, equations.gradient_local)
    alone, slope = columns.information.sum(axis=0), columns.gradient.sum(axis=0) - gains @ gradient
    for j, error in enumerate(scalars.errors, scalars.insets):
        curvature, by_prior = prior_row(error, priors, problem.model_errors.get(error, 0.0))
        alone[j, j] += curvature
        slope[j] += by_prior
    scale = np.sqrt(np.maximum(np.diagonal(alone), 1e-30))
    which = (*(None for _ in range(scalars.insets)), *scalars.errors)
    return JointScalars(which, alone - flat @ gains.T, slope, gains, scale)


def _common(column: Column, error: ErrorColumn) -> float:
    """Return the sum of weight times both derivatives over the rows that they share."""
    if isinstance(column, InsetColumn):
        mine = error.weighted.get(column.block)
        return 0.0 if mine is None else float(mine[:, 0] @ column.by_steps)
    shared = column.derivative.keys() & error.weighted.keys()
    return float(sum(np.sum(error.weighted[i] * column.derivative[i]) for i in shared))


def better_scalars(
    problem: Problem,
    assessment: Assessment,
    error_columns: Sequence[ErrorColumn],
    loss: str,
    insets: np.ndarray,
    errors: np.ndarray,
    priors: ErrorPriors,
) -> Tuple[np.ndarray, np.ndarray]:
    """Return insets and model errors after one Newton step of the joint problem.

    Args:
        problem: with the present ones.
        assessment: of the problem at or near the minimum for them.
        error_columns: of the model errors.
        loss: of the rounds.
        insets: (b,) by residual block, in steps of the sampling; 0 for blocks of other kinds.
        errors: (e,) of the columns' errors, in units of their steps.
        priors: of some errors.
    """
    inset_columns = assessment.columns
    if not inset_columns and not error_columns:
        return insets, errors
    joint = joint_scalars(problem, assessment.equations, inset_columns, error_columns, priors)
    step = losses.step_length(loss) * joint.newton_step()
    chosen, new = [c.block for c in inset_columns], insets.copy()
    new[chosen] = np.clip(insets[chosen] + step[: len(chosen)], 0.0, MOST_STEPS)
    of_columns = [column.error for column in error_columns]
    return new, within_reason(of_columns, errors + step[len(chosen) :])
