"""The sigmas of each sensor and kind, from its residuals and their redundancy."""

from __future__ import annotations

from typing import Sequence

import numpy as np

from atom_core.problem.problem import Problem
from atom_core.problem.residuals import BORDER, ORTHOGONAL, REPROJECTION
from atom_core.solvers import losses
from atom_core.solvers.covariance import Covariance
from atom_core.solvers.free_fit import median
from atom_core.solvers.normal_equations import NormalEquations

SMALLEST_SIGMA = {REPROJECTION: 0.01, ORTHOGONAL: 1e-5, BORDER: 1e-4}  # px, m, m
# Median of |r| / sigma of a Gaussian in one and in two dimensions.
MEDIAN_OF_NORM = {1: 0.67449, 2: 1.17741}


def scale_factors(
    problem: Problem,
    equations: NormalEquations,
    squares: Sequence[np.ndarray],
    sigmas: Sequence[np.ndarray],
    loss: str,
) -> np.ndarray:
    """Return (b,) by which the sigmas of each residual block are too small.

    Args:
        problem: whose rows.
        equations: of the problem with these sigmas.
        squares: for each residual block, squared norms (n,) in units of sigma.
        sigmas: for each residual block, (n,) in its unit.
        loss: robust loss; without one the mean square decides, with one the median.
    """
    explained = Covariance(equations).explained(problem, equations)
    factors = []
    for block, square, sigma, used in zip(problem.residual_blocks, squares, sigmas, explained):
        rows = block.count * block.dimension
        redundancy = max(rows - used, 0.05 * rows)
        if loss == losses.NONE:
            factor = np.sqrt(np.sum(square) / redundancy)
        else:
            middle = np.sqrt(median(square)) / MEDIAN_OF_NORM[block.dimension]
            factor = middle * np.sqrt(rows / redundancy)
        if factor * np.min(sigma) < SMALLEST_SIGMA[block.kind]:  # else the median is above it
            factor = max(factor, SMALLEST_SIGMA[block.kind] / float(np.median(sigma)))
        factors.append(float(factor))
    return np.array(factors)
