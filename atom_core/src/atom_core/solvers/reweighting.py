"""Solve with weights that mean something: sigmas from the residuals, in rounds.

Each sensor and kind of residual has one factor on its initial sigmas. After a solve the factor
is re-estimated from the residuals and their redundancy (variance components, Foerstner 1979),
until it stands still. With a robust loss the median absolute deviation takes the place of the
mean square, so that gross errors do not count.

In the same rounds each range sensor's limit points are moved out to the border: they lie inside
it by half a step of the sampling, which would make the board look small.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Optional, Sequence, Tuple

import numpy as np

from atom_core.problem.problem import Problem
from atom_core.problem.residuals import REPROJECTION, BorderBlock
from atom_core.solvers import losses
from atom_core.solvers.anderson import AndersonAcceleration
from atom_core.solvers.base import (
    ATOM,
    CONVERGED,
    FAILED,
    NOT_CONVERGED,
    Iteration,
    Minimum,
    RoundProgress,
    Solver,
    SolverOptions,
    SolverSummary,
)
from atom_core.solvers.covariance import Covariance
from atom_core.solvers.criteria import EXACT, ROUGH, SETTLING, Tolerance
from atom_core.solvers.detection_noise import covariance_by_detections
from atom_core.solvers.error_columns import apply_errors, error_columns, in_steps, in_units
from atom_core.solvers.insets import apply_insets
from atom_core.solvers.scalars import better_scalars, joint_scalars
from atom_core.solvers.variance_components import scale_factors

# Relative change of a factor below which the rounds become finer, and below which they end.
_ENOUGH_ROUNDS = 5  # to see whether sigmas settle
_NEARLY_STILL, _STILL = 0.05, 3e-4
# When the rounds are used up, it is enough that a factor changes by so much of its own deviation,
# and an inset by so many steps: few residuals have a median that never stands quite still.
_OF_DEVIATION, _STILL_STEPS = 0.1, 3e-3
_SMALLEST_NORMALISER = 1e-9  # a perfect guess must not divide by zero


def rough_minimum(
    solver: Solver,
    start: np.ndarray,
    options: SolverOptions,
    done: int = 0,
    loss: str = losses.NONE,
) -> Minimum:
    """Return a first answer with the initial sigmas and, unless asked for, no robust loss.

    Far from the solution every residual is large, and a robust loss would drop them all.
    ``done`` iterations are behind; they are counted in the result.
    """
    rough = replace(options, loss=loss)
    return _minimise(solver, start, solver.problem.initial_sigmas, rough, done, ROUGH)


def _minimise(
    solver: Solver,
    x: np.ndarray,
    sigmas: Sequence[np.ndarray],
    options: SolverOptions,
    done: int,
    tolerance: Tolerance,
) -> Minimum:
    """Go on from x; ``done`` iterations are behind, and so many are in the result at least."""
    left = max(options.max_iterations - done, 0)
    progress, problem = options.progress, solver.problem
    callback: Optional[RoundProgress] = None
    if progress is not None:

        def callback(number: int, cost: float, now: np.ndarray) -> Optional[bool]:
            return progress(Iteration(done + number, cost, now, problem))

    end = solver.minimise(x, sigmas, options.loss, left, tolerance, callback)
    return replace(end, iterations=done + end.iterations)


def solve(
    solver: Solver,
    options: SolverOptions,
    rough: Optional[Minimum] = None,
    guess: Optional[Solver] = None,
) -> SolverSummary:
    """Solve a problem.

    Args:
        solver: made for the problem.
        options: weights, loss, limits.
        rough: a first answer to go on from; found here if None.
        guess: of the problem at the user's initial guess, from which ATOM takes its weights; the
            solver itself if None.
    """
    zero = np.zeros(solver.problem.parameters.size)
    rough = rough or rough_minimum(solver, zero, options)
    if options.weights == ATOM:
        first = guess or solver
        start = np.zeros(first.problem.parameters.size)
        sigmas = atom_normalisers(first, start, options.corner_divisor)
        end = rough
        if not rough.interrupted:
            end = _minimise(solver, rough.x, sigmas, options, rough.iterations, EXACT)
        return _summary(solver, options, end, sigmas, np.zeros(len(sigmas)))
    count = len(solver.problem.residual_blocks)
    means = {error: prior.mean for error, prior in options.error_priors.items()}
    expected = in_steps(options.model_errors, means)
    if np.any(expected):
        apply_errors(solver, rough.x, options.model_errors, expected)
    summary = _reweighted(solver, options, rough, np.ones(count), np.zeros(count), expected)
    finite = np.all(np.isfinite([*summary.scales, summary.cost_final]))
    if summary.status == FAILED and finite:
        # The start was better: without a robust loss, gross errors drew the answer away from it.
        return _from_the_start(solver, options, summary)
    return summary


def _from_the_start(
    solver: Solver, options: SolverOptions, summary: SolverSummary
) -> SolverSummary:
    """Return the solution next to the start, given the sigmas and insets of another one."""
    start, values = np.zeros(solver.problem.parameters.size), summary.model_errors
    apply_errors(solver, start, options.model_errors, in_steps(options.model_errors, values))
    fresh = replace(options, max_iterations=summary.iterations + options.max_iterations)
    near = _minimise(solver, start, summary.sigmas, fresh, summary.iterations, ROUGH)
    scales, insets = np.array(summary.scales), np.array(summary.inset_steps)
    return _reweighted(solver, fresh, near, scales, insets, in_steps(options.model_errors, values))


def solve_again(
    solver: Solver,
    options: SolverOptions,
    before: Problem,
    summary: SolverSummary,
    start: Optional[np.ndarray] = None,
) -> SolverSummary:
    """Solve a problem that has changed a little; sigmas and insets go on from where they were.

    Args:
        solver: made for the problem, which may have lost some detections.
        options: weights, loss, limits.
        before: the problem before.
        summary: its solution; the iterations go on counting, but their limit begins anew.
        start: where to go on; zero if None, for a problem whose initial values are the solution.
    """
    problem = solver.problem
    place = {(b.sensor, b.kind): i for i, b in enumerate(before.residual_blocks)}
    kept = [place[(b.sensor, b.kind)] for b in problem.residual_blocks]
    scales, insets = (np.array(v)[kept] for v in (summary.scales, summary.inset_steps))
    start = np.zeros(problem.parameters.size) if start is None else start
    values = in_steps(options.model_errors, summary.model_errors)
    apply_errors(solver, start, options.model_errors, values)
    problem = solver.problem
    poses = problem.poses(start)
    expected = {
        i: insets[i] * block.steps_across(poses)
        for i, block in enumerate(problem.residual_blocks)
        if isinstance(block, BorderBlock)
    }
    solver.take_insets(problem.with_insets(expected))
    sigmas = tuple(b.sigma * scale for b, scale in zip(problem.residual_blocks, scales))
    # What was left out may have used the iterations up: it is another problem now.
    fresh = replace(options, max_iterations=summary.iterations + options.max_iterations)
    rough = _minimise(solver, start, sigmas, fresh, summary.iterations, ROUGH)
    again = _reweighted(solver, fresh, rough, scales, insets, values)
    return replace(again, cost_initial=summary.cost_initial)


def solve_with_sigmas(
    solver: Solver, options: SolverOptions, summary: SolverSummary, sigmas: Sequence[np.ndarray]
) -> SolverSummary:
    """Go on from a solution with given sigmas, which stay; insets and model errors stay too.

    Args:
        solver: of the problem.
        options: loss, limits.
        summary: its solution; the iterations go on counting, but their limit begins anew.
        sigmas: for each residual block, (n,) in its unit.
    """
    fresh = replace(options, max_iterations=summary.iterations + options.max_iterations)
    end = _minimise(solver, summary.x, sigmas, fresh, summary.iterations, EXACT)
    again = _summary(solver, options, end, tuple(sigmas), np.array(summary.inset_steps))
    return replace(again, model_errors=summary.model_errors)


def _reweighted(
    solver: Solver,
    options: SolverOptions,
    rough: Minimum,
    scales: np.ndarray,
    insets: np.ndarray,
    values: np.ndarray,
) -> SolverSummary:
    """Solve in rounds, from a rough answer for some scales (b,), insets (b,) and errors (e,)."""
    end, tolerance = rough, ROUGH
    initial = solver.problem.initial_sigmas
    sigmas = tuple(s * scale for s, scale in zip(initial, scales))
    count, settled = len(sigmas), False
    errors, priors = options.model_errors, options.error_priors
    change = np.full(2 * count + len(values), np.inf)
    state = AndersonAcceleration(np.concatenate([np.log(scales), insets, values]))
    rounds = 0
    while rounds < options.reweighting_rounds and not end.interrupted:
        rounds += 1
        assessment = solver.assess(end.x, sigmas, options.loss)
        _, insets, values = np.split(state.value, [count, 2 * count])
        columns = error_columns(solver.problem, end.x, sigmas, options.loss, errors, priors)
        now, values_now = better_scalars(
            solver.problem, assessment, columns, options.loss, insets, values, priors
        )
        apply_insets(solver, assessment.columns, now)
        apply_errors(solver, end.x, errors, values_now)
        squares = solver.squares(end.x, sigmas)
        factors = scale_factors(solver.problem, assessment.equations, squares, sigmas, options.loss)
        change = np.concatenate([np.log(factors), now - insets, values_now - values])
        scales, insets, values = np.split(state.advance(change), [count, 2 * count])
        sigmas = tuple(s * np.exp(scale) for s, scale in zip(initial, scales))
        apply_insets(solver, assessment.columns, insets)
        apply_errors(solver, end.x, errors, values)
        settled = bool(np.max(np.abs(change)) < _STILL)
        if settled or end.iterations >= options.max_iterations:
            break
        tolerance = SETTLING if np.max(np.abs(change)) < _NEARLY_STILL else tolerance
        end = _minimise(solver, end.x, sigmas, options, end.iterations, tolerance)
    if not end.interrupted:
        end = _minimise(solver, end.x, sigmas, options, end.iterations, EXACT)
    settled = settled or _stands_still(solver.problem, change)
    if not settled and not end.interrupted:
        why = f"the sigmas do not settle in {end.iterations} iterations"
        end = replace(end, converged=False, message=why)
    _, insets, values = np.split(state.value, [count, 2 * count])
    summary = _summary(solver, options, end, sigmas, insets)
    # Where the limit leaves few rounds, that is the reason, and not the sigmas.
    settled = settled or (end.iterations >= options.max_iterations and rounds < _ENOUGH_ROUNDS)
    return replace(summary, model_errors=in_units(errors, values), settled=settled)


def _stands_still(problem: Problem, change: np.ndarray) -> bool:
    """Tell whether the last change of all scalars is far below their deviation."""
    rows = np.array([block.count * block.dimension for block in problem.residual_blocks])
    factors = np.maximum(_OF_DEVIATION / np.sqrt(2.0 * rows), _STILL)
    allowed = np.full(len(change), _STILL)
    allowed[: len(rows)], allowed[len(rows) : 2 * len(rows)] = factors, _STILL_STEPS
    return bool(np.all(np.abs(change) < allowed))


def atom_normalisers(
    solver: Solver, x: np.ndarray, corner_divisor: float = 1.0
) -> Tuple[np.ndarray, ...]:
    """Return ATOM's weights as sigmas: each modality's mean residual at x, as ATOM does.

    Orthogonal and border residuals of a modality share one mean; that of corners is multiplied.
    """
    blocks = solver.problem.residual_blocks
    squares = solver.squares(x, [np.ones(block.count) for block in blocks])
    means = {}
    for modality in {block.modality for block in blocks}:
        mine = [np.sqrt(s) for s, block in zip(squares, blocks) if block.modality == modality]
        means[modality] = max(float(np.mean(np.concatenate(mine))), _SMALLEST_NORMALISER)
    factors = [corner_divisor if block.kind == REPROJECTION else 1.0 for block in blocks]
    return tuple(np.full(b.count, f * means[b.modality]) for b, f in zip(blocks, factors))


def _summary(
    solver: Solver,
    options: SolverOptions,
    end: Minimum,
    sigmas: Tuple[np.ndarray, ...],
    insets: np.ndarray,
) -> SolverSummary:
    parameters = solver.problem.parameters
    start = np.zeros(parameters.size)
    first, last = (solver.squares(x, sigmas) for x in (start, end.x))
    cost_initial, cost_final = (
        losses.total_cost(options.loss, squares) + parameters.prior_cost(x)
        for squares, x in ((first, start), (last, end.x))
    )
    status = CONVERGED if end.converged else NOT_CONVERGED
    summary = SolverSummary(
        x=end.x,
        status=status,
        message=_message(end),
        iterations=end.iterations,
        cost_initial=cost_initial,
        cost_final=cost_final,
        sigmas=sigmas,
        scales=tuple(
            float(np.median(s / b.sigma)) for s, b in zip(sigmas, solver.problem.residual_blocks)
        ),
        inset_steps=tuple(float(v) for v in insets),
        interrupted=end.interrupted,
    )
    if not np.isfinite(cost_final) or cost_final > cost_initial:
        return replace(
            summary,
            x=start,
            status=NOT_CONVERGED if end.interrupted else FAILED,
            message=_message(end, start_is_kept=True),
            cost_final=cost_initial,
        )
    return summary


def _message(end: Minimum, start_is_kept: bool = False) -> str:
    if end.interrupted:
        kept = "this is the best state so far"
        if start_is_kept:
            kept = "the start is kept, which was better"
        return f"interrupted after {end.iterations} iterations; {kept}"
    if start_is_kept:
        return "the solver ended worse than it started; the start is kept"
    return end.message


def covariance_of(solver: Solver, summary: SolverSummary, options: SolverOptions) -> Covariance:
    """Return the covariance of the parameters at the solution."""
    if summary.common:
        return covariance_by_detections(solver, summary, options)
    equations = solver.equations(summary.x, summary.sigmas, options.loss)
    scale = 1.0
    if options.weights == ATOM:  # its weights are no variances: scale by the residuals
        redundancy = max(solver.problem.row_count - solver.problem.parameters.free_count, 1)
        scale = 2.0 * summary.cost_final / redundancy
    covariance = Covariance(equations, scale)
    if not summary.model_errors:
        return covariance
    assessment = solver.assess(summary.x, summary.sigmas, options.loss)
    errors, priors = list(summary.model_errors), options.error_priors
    columns = error_columns(solver.problem, summary.x, summary.sigmas, options.loss, errors, priors)
    joint = joint_scalars(solver.problem, equations, assessment.columns, columns, priors)
    return covariance.bordered(joint)
