"""How sure the shared numbers are, seen from how much the collections differ.

The covariance of the normal equations holds where the noise is as assumed: independent from point
to point. Real detections are off as a whole. What remains true is that collections are independent
of one another: leaving out each in turn (jackknife, Efron 1982; equivalent to the sandwich
covariance with clusters, Cameron and Miller 2015) shows how much the answer hangs on any of them.
"""

from __future__ import annotations

from typing import Sequence, Tuple

import numpy as np
from scipy import special

from atom_core.problem.blocks import BLOCK_SIZE
from atom_core.problem.model_errors import ModelError
from atom_core.solvers.shared_equations import SharedEquations, inverse

FEWEST = 4  # collections; fewer do not tell
_FEW = 8  # fewer may happen to be off alike
_QUANTILE = 0.975  # of the interval that is to hold the truth in 95 %
_LEAST_TOLD = 1e-3  # part of a variance that comes from the collections; less tells nothing
_LEFT_OUT = 0.95  # part of a collection that is left out: some number may hang on it alone


def sigma_factors(
    equations: SharedEquations, cautious: SharedEquations, estimated: Sequence[ModelError]
) -> np.ndarray:
    """Return (n,) by how much the model's standard deviations are too small; never below one.

    Of the shared blocks' numbers, then of the insets, then of the estimated errors. Rotations of a
    block have one factor in common, and so have its translations: few collections tell no more.
    Where there are too few to tell anything, the cautious equations do; where there are few, the
    larger of the two counts.

    Args:
        equations: at the solution.
        cautious: likewise, with what the rows of a detection may have in common.
        estimated: the model errors that were estimated.
    """
    place = equations.place
    base = [*range(equations.shared), *(place[e] for e in estimated if e in place)]
    model, known = _model_variance(equations, base)
    count, numbers = len(equations.collections), BLOCK_SIZE * equations.blocks
    is_told = model - known > _LEAST_TOLD * model
    told = np.where(is_told, model - known, np.inf)  # what the collections leave open
    ratios = np.zeros(len(base))
    if count >= FEWEST:
        # A deviation seen in few collections is itself not sure.
        wider = wider_by_students_t(max(count / 2.0, 3.0))
        ratios = wider**2 * _jackknife_variance(equations, base) / told
    if count < _FEW:
        careful, also_known = _model_variance(cautious, base)
        ratios = np.maximum(ratios, (careful - also_known) / told)
    triples = ratios[:numbers].reshape(-1, BLOCK_SIZE // 2)
    counted = (equations.free & is_told[:numbers]).reshape(triples.shape)
    means = np.sum(triples * counted, axis=1) / np.maximum(np.sum(counted, axis=1), 1)
    ratios[:numbers] = np.repeat(means, BLOCK_SIZE // 2)
    share = np.maximum(model - known, 0.0) / np.maximum(model, 1e-30)
    return np.maximum(np.sqrt(1.0 + (ratios - 1.0) * share), 1.0)


def wider_by_students_t(freedom: float) -> float:
    """Return by how much the quantile of a 95 % interval is larger than the normal one."""
    return float(special.stdtrit(freedom, _QUANTILE) / special.ndtri(_QUANTILE))


def degrees_of_freedom(collections: int) -> float:
    """Return how many independent numbers told the scatter; infinite where few told nothing."""
    return collections / 2.0 if collections >= _FEW else np.inf


def _model_variance(
    equations: SharedEquations, base: Sequence[int]
) -> Tuple[np.ndarray, np.ndarray]:
    """Return (n,) variances of the numbers of the base, as the normal equations have them.

    And (n,) the part of them that comes from what the user knows beforehand, which is the same
    whatever the collections say.
    """
    covariance = inverse(equations.total[np.ix_(base, base)])
    of_blocks = covariance[:, : len(equations.stated)]
    return np.diagonal(covariance), np.sum(of_blocks**2 * equations.stated, axis=1)


def _jackknife_variance(equations: SharedEquations, base: Sequence[int]) -> np.ndarray:
    """Return (n,) variances of the numbers of the base, as leaving out collections has them.

    For a collection with information A and gradient g in its own numbers E, and all information T,
    ``(T - E A E')^-1 E g`` is ``T^-1 E (1 - A E' T^-1 E)^-1 g``: one inverse serves all.
    """
    covariance = inverse(equations.total[np.ix_(base, base)])
    place = np.full(len(equations.total), -1)
    place[list(base)] = np.arange(len(base))
    moved = np.empty((len(equations.parts), len(base)))
    for c, part in enumerate(equations.parts):
        known = place[part.numbers] >= 0
        own = place[part.numbers[known]]
        left_out = _LEFT_OUT * part.information[np.ix_(known, known)]
        without = np.eye(len(own)) - left_out @ covariance[np.ix_(own, own)]
        gradient = equations.gradient[c, part.numbers[known]]
        moved[c] = covariance[:, own] @ np.linalg.solve(without, gradient)
    moved -= moved.mean(axis=0)
    count = len(moved)
    return (count - 1.0) / count * np.sum(moved**2, axis=0)
