"""How sure the shared numbers are, seen from how much the collections differ.

The covariance of the normal equations holds where the noise is as assumed: independent from point
to point. Real detections are off as a whole. What remains true is that collections are independent
of one another: leaving out each in turn (jackknife, Efron 1982; equivalent to the sandwich
covariance with clusters, Cameron and Miller 2015) shows how much the answer hangs on any of them.
"""

from __future__ import annotations

from typing import Sequence

import numpy as np
from scipy import special

from atom_core.problem.blocks import BLOCK_SIZE
from atom_core.problem.model_errors import ModelError
from atom_core.solvers.shared_equations import SharedEquations, inverse

_FEWEST = 4  # collections; fewer do not tell
_QUANTILE = 0.975  # of the interval that is to hold the truth in 95 %
_LEFT_OUT = 0.95  # part of a collection that is left out: some number may hang on it alone


def sigma_factors(equations: SharedEquations, estimated: Sequence[ModelError]) -> np.ndarray:
    """Return (n,) by how much the model's standard deviations are too small; never below one.

    Of the shared blocks' numbers, then of the insets, then of the estimated errors. Rotations of a
    block have one factor in common, and so have its translations: few collections tell no more.

    Args:
        equations: at the solution.
        estimated: the model errors that were estimated.
    """
    place = {e: equations.shared + i for i, e in enumerate(equations.errors)}
    base = [*range(equations.shared), *(place[e] for e in estimated if e in place)]
    parts, gradients = equations.information[:, base][:, :, base], equations.gradient[:, base]
    count = len(parts)
    factors = np.ones(len(base))
    if count < _FEWEST:
        return factors
    total = parts.sum(axis=0) + equations.held[np.ix_(base, base)]
    model = np.diagonal(inverse(total))
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(total), 1e-30))
    reduced = (total - _LEFT_OUT * parts) * scale[:, None] * scale
    reduced += 1e-12 * np.eye(len(base))
    moved = scale * np.linalg.solve(reduced, (scale * gradients)[:, :, None])[:, :, 0]
    moved -= moved.mean(axis=0)
    variance = (count - 1.0) / count * np.sum(moved**2, axis=0)
    ratios = variance / np.maximum(model, 1e-30)
    numbers = BLOCK_SIZE * equations.blocks
    triples = ratios[:numbers].reshape(-1, BLOCK_SIZE // 2)
    ratios[:numbers] = np.repeat(triples.mean(axis=1), BLOCK_SIZE // 2)
    # A deviation seen in few collections is itself not sure: Student's t has the wider interval.
    wider = special.stdtrit(max(count / 2.0, 3.0), _QUANTILE) / special.ndtri(_QUANTILE)
    return np.maximum(wider * np.sqrt(ratios), 1.0)
