"""Scalars that are estimated beside the poses: border insets and range offsets.

Together with the poses they make one joint problem. Its normal equations are those of the poses,
bordered by one column for each scalar; the poses are eliminated from them (Schur complement).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Optional, Sequence, Tuple, Union

import numpy as np

from atom_core.problem.problem import Problem
from atom_core.solvers import losses
from atom_core.solvers.assessment import Assessment, InsetColumn
from atom_core.solvers.insets import MOST_STEPS
from atom_core.solvers.normal_equations import Factor, NormalEquations, pulled_back
from atom_core.solvers.range_offsets import OffsetColumn, within_reason

Column = Union[InsetColumn, OffsetColumn]


@dataclass(frozen=True)
class JointScalars:
    """The bordered normal equations, reduced to k scalars.

    Attributes:
        columns: of the scalars.
        curvature: (k, k) when the poses follow.
        slope: (k,) when the poses follow.
        gains: (k, p) how the poses follow: minus their change by a scalar.
        scale: (k,) root of the curvature when the poses stay.
    """

    columns: Tuple[Column, ...]
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
    offsets: Sequence[OffsetColumn],
) -> JointScalars:
    """Return the reduced equations of all scalars, insets first."""
    columns: Tuple[Column, ...] = (*insets, *offsets)
    join = equations.layout.join
    vectors = [
        pulled_back(problem, equations.layout, equations.state_jacobians, c.detection, c.by_twist)
        for c in columns
    ]
    flat = np.array([join(*v) for v in vectors])
    factor, gains = _factor(equations), np.zeros_like(flat)
    if factor is not None:
        gains = np.array([join(*factor.solve(*v)) for v in vectors])
    gradient = join(equations.gradient_shared, equations.gradient_local)
    alone = np.diag([c.curvature for c in columns])
    for j, offset in enumerate(offsets, len(insets)):
        for i, inset in enumerate(insets):  # they share rows
            if inset.block in offset.weighted:
                alone[i, j] = alone[j, i] = offset.weighted[inset.block] @ inset.by_steps
    slope = np.array([c.slope for c in columns]) - gains @ gradient
    scale = np.sqrt(np.diagonal(alone))
    return JointScalars(columns, alone - flat @ gains.T, slope, gains, scale)


def better_scalars(
    problem: Problem,
    assessment: Assessment,
    offset_columns: Sequence[OffsetColumn],
    loss: str,
    insets: np.ndarray,
    offsets: np.ndarray,
) -> Tuple[np.ndarray, np.ndarray]:
    """Return insets and range offsets after one Newton step of the joint problem.

    Args:
        problem: with the present ones.
        assessment: of the problem at or near the minimum for them.
        offset_columns: of the range offsets.
        loss: of the rounds.
        insets: (b,) by residual block, in steps of the sampling; 0 for blocks of other kinds.
        offsets: (s,) of the columns' sensors, in units of UNIT_M.
    """
    inset_columns = assessment.columns
    if not inset_columns and not offset_columns:
        return insets, offsets
    joint = joint_scalars(problem, assessment.equations, inset_columns, offset_columns)
    step = losses.step_length(loss) * joint.newton_step()
    chosen, new = [c.block for c in inset_columns], insets.copy()
    new[chosen] = np.clip(insets[chosen] + step[: len(chosen)], 0.0, MOST_STEPS)
    return new, within_reason(offsets + step[len(chosen) :])


def _factor(equations: NormalEquations) -> Optional[Factor]:
    for damping in (0.0, 1e-12, 1e-9, 1e-6):
        try:
            return Factor(equations, damping)
        except np.linalg.LinAlgError:
            continue
    return None
