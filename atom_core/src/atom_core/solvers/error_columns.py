"""Model errors as columns of the joint problem: how the rows depend on them, reduced.

Like the insets, a model error is not one of the solver's parameters: where it is estimated, it
takes the Newton step of the joint problem in each round of reweighting (`scalars.py`). It is off
unless asked for, since it weakens the poses: where all boards are equally far and look the same
way, a range offset and a shift of the sensor can hardly be told apart.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Dict, List, Mapping, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.problem.corrections import corrected
from atom_core.problem.model_errors import ErrorPriors, ModelError, rows_of
from atom_core.problem.problem import Linearisation, Problem
from atom_core.problem.residuals import squared_norms
from atom_core.solvers import losses
from atom_core.solvers.base import Solver


class ErrorColumn(NamedTuple):
    """The derivatives of the rows by a model error in units of its step, reduced.

    Attributes:
        error: which.
        curvature: sum of weight times derivative squared.
        slope: sum of weight times derivative times residual.
        detection: (d,) all detections.
        by_state: (d, 6 or 18) what the error and the detections' states have in common.
        derivative: by index of the residual block, (n, dimension).
        weighted: likewise, weight times derivative.
    """

    error: ModelError
    curvature: float
    slope: float
    detection: np.ndarray
    by_state: np.ndarray
    derivative: Mapping[int, np.ndarray]
    weighted: Mapping[int, np.ndarray]


def error_columns(
    problem: Problem,
    x: np.ndarray,
    sigmas: Sequence[np.ndarray],
    loss: str,
    errors: Sequence[ModelError],
    known: ErrorPriors = MappingProxyType({}),
) -> List[ErrorColumn]:
    """Return the columns of some model errors at the vector x.

    Of those that have rows or, among ``known``, a prior.
    """
    if not errors:
        return []
    linearisation, poses = problem.linearise(x), problem.poses(x)
    weights = [row_weight(r, s, loss) for r, s in zip(linearisation.residuals, sigmas)]
    columns = [_column(problem, e, linearisation, poses, weights) for e in errors]
    return [column for column in columns if column.curvature > 0 or column.error in known]


def without_rows(
    problem: Problem, errors: Sequence[ModelError], known: ErrorPriors
) -> List[ModelError]:
    """Return the errors on which no row depends, and of which nothing is known beforehand."""
    x, sigmas = np.zeros(problem.parameters.size), problem.initial_sigmas
    seen = {c.error for c in error_columns(problem, x, sigmas, losses.NONE, errors, known)}
    return [error for error in errors if error not in seen]


def row_weight(residual: np.ndarray, sigma: np.ndarray, loss: str) -> np.ndarray:
    """Return (n,): robust weight over sigma squared, of residuals (n, dimension)."""
    return losses.weight(loss, squared_norms(residual, sigma)) / sigma**2


def _column(
    problem: Problem,
    error: ModelError,
    linearisation: Linearisation,
    poses: np.ndarray,
    weights: Sequence[np.ndarray],
) -> ErrorColumn:
    curvature, slope = 0.0, 0.0
    by_state = np.zeros((len(poses), linearisation.state_jacobians.shape[2]))
    derivatives: Dict[int, np.ndarray] = {}
    weighted: Dict[int, np.ndarray] = {}
    parts = zip(problem.residual_blocks, linearisation.residuals, linearisation.by_state)
    for i, (block, residual, by_block_state) in enumerate(parts):
        by_error = error.derivatives(
            rows_of(block, poses, problem.patterns, residual, by_block_state)
        )
        if by_error is None:
            continue
        derivatives[i] = error.step * by_error
        weighted[i] = weights[i][:, None] * derivatives[i]
        curvature += float(np.sum(weighted[i] * derivatives[i]))
        slope += float(np.sum(weighted[i] * residual))
        common = np.einsum("nr,nrs->ns", weighted[i], by_block_state)
        detection, summed = block.sums(common)
        by_state[detection, : common.shape[1]] += summed
    everything = np.arange(len(poses))
    return ErrorColumn(error, curvature, slope, everything, by_state, derivatives, weighted)


def apply_errors(
    solver: Solver, x: np.ndarray, errors: Sequence[ModelError], steps: np.ndarray
) -> None:
    """Let a solver go on with other values (e,) of model errors, in units of their steps."""
    if errors:
        solver.take_rows(corrected(solver.problem, in_units(errors, steps), x))


def in_units(errors: Sequence[ModelError], steps: np.ndarray) -> Dict[ModelError, float]:
    """Return values (e,) in units of their steps by error, in the units of the errors."""
    return {error: float(error.step * value) for error, value in zip(errors, steps)}


def in_steps(errors: Sequence[ModelError], values: Mapping[ModelError, float]) -> np.ndarray:
    """Return (e,) values in units of their steps; zero where there is none."""
    return np.array([values.get(error, 0.0) / error.step for error in errors])


def within_reason(errors: Sequence[ModelError], steps: np.ndarray) -> np.ndarray:
    """Return values (e,), in units of their steps, cut off where they cannot be meant."""
    most = np.array([error.most / error.step for error in errors])
    return np.clip(steps, -most, most)


def prior_row(error: ModelError, priors: ErrorPriors, value: float) -> Tuple[float, float]:
    """Return what a prior adds to an error's equation, in units of its step; zeros for none.

    Args:
        error: which.
        priors: of some errors.
        value: of the error at present, in its unit.

    Returns:
        curvature and slope.
    """
    if error not in priors:
        return 0.0, 0.0
    sigma, mean = priors[error]
    information = (error.step / sigma) ** 2
    return information, information * (value - mean) / error.step
