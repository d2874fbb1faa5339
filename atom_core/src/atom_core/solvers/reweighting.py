"""Solve with weights that mean something: sigmas from the residuals, in rounds.

Each sensor and kind of residual has one factor on its initial sigmas. After a solve the factor
is re-estimated from the residuals and their redundancy (variance components, Foerstner 1979),
until it stands still. With a robust loss the median absolute deviation takes the place of the
mean square, so that gross errors do not count.
"""

from __future__ import annotations

from dataclasses import replace
from typing import List, Optional, Sequence, Tuple

import numpy as np

from atom_core.problem.problem import Problem
from atom_core.problem.residuals import BORDER, ORTHOGONAL, REPROJECTION, squared_norms
from atom_core.solvers import losses
from atom_core.solvers.base import (
    ATOM,
    CONVERGED,
    EXACT,
    FAILED,
    NOT_CONVERGED,
    ROUGH,
    Minimise,
    Minimum,
    SolverOptions,
    SolverSummary,
)
from atom_core.solvers.covariance import Covariance
from atom_core.solvers.normal_equations import Layout
from atom_core.solvers.scipy_solver import equations_at, minimise, robust_weights, total_cost

_STILL = 0.01  # relative change of a factor below which the sigmas count as settled
_SMALLEST_SIGMA = {REPROJECTION: 0.01, ORTHOGONAL: 1e-5, BORDER: 1e-4}  # px, m, m
_SMALLEST_NORMALISER = 1e-9  # a perfect guess must not divide by zero
# Median of |r| / sigma of a Gaussian in one and in two dimensions.
_MEDIAN_OF_NORM = {1: 0.67449, 2: 1.17741}


def rough_minimum(
    problem: Problem, start: np.ndarray, options: SolverOptions, minimiser: Minimise = minimise
) -> Minimum:
    """Return a first answer with the initial sigmas and no robust loss.

    Far from the solution every residual is large, and a robust loss would drop them all.
    """
    sigmas = tuple(block.sigma for block in problem.residual_blocks)
    return minimiser(problem, start, sigmas, losses.NONE, options.max_iterations, ROUGH)


def solve(
    problem: Problem,
    options: SolverOptions,
    rough: Optional[Minimum] = None,
    minimiser: Minimise = minimise,
) -> SolverSummary:
    """Solve a problem.

    Args:
        problem: what to solve.
        options: weights, loss, limits.
        rough: a first answer to go on from; found here if None.
        minimiser: which solver does the work of one round.
    """
    zero = np.zeros(problem.parameters.size)
    rough = rough or rough_minimum(problem, zero, options, minimiser)
    left = max(options.max_iterations - rough.iterations, 1)
    if options.weights == ATOM:
        sigmas = atom_normalisers(problem, zero)
        end = minimiser(problem, rough.x, sigmas, options.loss, left, EXACT)
        return _summary(problem, options, end, sigmas, rough.iterations + end.iterations)
    return _reweighted(problem, options, minimiser, rough)


def _reweighted(
    problem: Problem, options: SolverOptions, minimiser: Minimise, rough: Minimum
) -> SolverSummary:
    x, iterations = rough.x, rough.iterations
    sigmas = tuple(block.sigma for block in problem.residual_blocks)
    for _ in range(options.reweighting_rounds):
        factors = _sigma_factors(problem, x, sigmas, options.loss)
        sigmas = tuple(s * f for s, f in zip(sigmas, factors))
        if all(abs(f - 1.0) < _STILL for f in factors):
            break
        left = max(options.max_iterations - iterations, 1)
        end = minimiser(problem, x, sigmas, options.loss, left, ROUGH)
        x, iterations = end.x, iterations + end.iterations
    left = max(options.max_iterations - iterations, 1)
    end = minimiser(problem, x, sigmas, options.loss, left, EXACT)
    return _summary(problem, options, end, sigmas, iterations + end.iterations)


def atom_normalisers(problem: Problem, x: np.ndarray) -> Tuple[np.ndarray, ...]:
    """Return ATOM's weights as sigmas: each modality's mean residual at x (atom_reference 5.7).

    Orthogonal and border residuals of a modality share one mean.
    """
    magnitudes = [np.linalg.norm(r, axis=1) for r in problem.residuals(x)]
    modalities = [block.modality for block in problem.residual_blocks]
    means = {}
    for modality in modalities:
        mine = [m for m, owner in zip(magnitudes, modalities) if owner == modality]
        means[modality] = max(float(np.mean(np.concatenate(mine))), _SMALLEST_NORMALISER)
    return tuple(np.full(len(m), means[owner]) for m, owner in zip(magnitudes, modalities))


def _sigma_factors(
    problem: Problem, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str
) -> List[float]:
    layout = Layout(problem.parameters)
    line = problem.linearise(x)
    equations = equations_at(problem, layout, x, sigmas, loss)
    explained = Covariance(equations).explained(problem, equations, line.maps)
    factors = []
    for block, residual, sigma, used in zip(
        problem.residual_blocks, line.residuals, sigmas, explained
    ):
        rows = block.count * block.dimension
        redundancy = max(rows - used, 0.05 * rows)
        squares = squared_norms(residual, sigma)
        if loss == losses.NONE:
            factor = np.sqrt(np.sum(squares) / redundancy)
        else:
            median = np.sqrt(np.median(squares)) / _MEDIAN_OF_NORM[block.dimension]
            factor = median * np.sqrt(rows / redundancy)
        smallest = _SMALLEST_SIGMA[block.kind] / float(np.median(sigma))
        factors.append(float(max(factor, smallest)))
    return factors


def _summary(
    problem: Problem,
    options: SolverOptions,
    end: Minimum,
    sigmas: Tuple[np.ndarray, ...],
    iterations: int,
) -> SolverSummary:
    start = np.zeros(problem.parameters.size)
    first = problem.residuals(start)
    cost_initial = total_cost(first, sigmas, options.loss)
    residuals = problem.residuals(end.x)
    cost_final = total_cost(residuals, sigmas, options.loss)
    status = CONVERGED if end.converged else NOT_CONVERGED
    summary = SolverSummary(
        x=end.x,
        status=status,
        message=end.message,
        iterations=iterations,
        cost_initial=cost_initial,
        cost_final=cost_final,
        sigmas=sigmas,
        scales=tuple(
            float(np.median(s / b.sigma)) for s, b in zip(sigmas, problem.residual_blocks)
        ),
        robust_weights=tuple(robust_weights(residuals, sigmas, options.loss)),
    )
    if not np.isfinite(cost_final) or cost_final > cost_initial:
        return replace(
            summary,
            x=start,
            status=FAILED,
            message="the solver ended worse than it started; the start is kept",
            cost_final=cost_initial,
            robust_weights=tuple(robust_weights(first, sigmas, options.loss)),
        )
    return summary


def covariance_of(problem: Problem, summary: SolverSummary, options: SolverOptions) -> Covariance:
    """Return the covariance of the parameters at the solution."""
    layout = Layout(problem.parameters)
    equations = equations_at(problem, layout, summary.x, summary.sigmas, options.loss)
    scale = 1.0
    if options.weights == ATOM:  # its weights are no variances: scale by the residuals
        redundancy = max(problem.row_count - problem.parameters.size, 1)
        scale = 2.0 * summary.cost_final / redundancy
    return Covariance(equations, scale)
