"""Solve with detections that are off as a whole, beside the noise of their corners and points.

Waves in a depth image, layers of a LiDAR that read long, a board that is not quite flat: what is
wrong is much the same for all rows of a detection. Then a detection of a thousand points says
hardly more than one of a hundred. Each residual block gets a second standard deviation, of what its
rows of a detection have in common; it is estimated from how far the detections would move if each
had its own pose, and from their redundancy (variance components, Foerstner 1979). The sigmas of
single rows stay as they are, and so does the robust loss.
"""

from __future__ import annotations

from dataclasses import replace
from typing import List, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.problem.blocks import BLOCK_SIZE
from atom_core.problem.problem import Problem
from atom_core.problem.residuals import BorderBlock
from atom_core.solvers import losses
from atom_core.solvers.base import NOT_CONVERGED, Solver, SolverOptions, SolverSummary
from atom_core.solvers.covariance import Covariance
from atom_core.solvers.error_columns import apply_errors, in_steps, in_units, within_reason
from atom_core.solvers.insets import MOST_STEPS
from atom_core.solvers.normal_equations import NormalEquations
from atom_core.solvers.scalar_columns import Scalars, scalars_of
from atom_core.solvers.scalars import JointScalars, joint_of
from atom_core.solvers.shared_equations import shares_of, tempered
from atom_core.solvers.variance_components import scale_factors

_ROUNDS = 30
_STILL = 0.01  # of a step beside its standard deviation
_MOVING = 0.1  # the same, after the last round: the answer would be another one with more rounds
_SMALLEST = 1e-9  # relative eigenvalue of a detection's information that counts as seen


class _State(NamedTuple):
    """Where the rounds stand: numbers, insets [steps], model errors [steps], common parts."""

    x: np.ndarray
    insets: np.ndarray
    errors: np.ndarray
    common: np.ndarray


class _System(NamedTuple):
    """The joint equations at a state."""

    equations: NormalEquations
    scalars: Scalars
    joint: JointScalars


def weighted_by_detections(
    solver: Solver, summary: SolverSummary, options: SolverOptions
) -> SolverSummary:
    """Return the solution with common parts estimated; the solver's problem is corrected anew.

    Model errors that the summary does not have yet begin at zero. Where the shared poses still
    move when the rounds end, the solution has not converged.

    Args:
        solver: of the problem.
        summary: its solution.
        options: of the solution.
    """
    errors, problem = list(options.model_errors), solver.problem
    scales, state = np.ones(len(summary.sigmas)), _first_state(summary, options)
    sigmas, largest = summary.sigmas, 0.0
    for _ in range(_ROUNDS):
        system = _system(solver, state, sigmas, options)
        covariance = Covariance(system.equations).bordered(system.joint)
        raw = solver.equations(state.x, sigmas, options.loss)
        common = _common_parts(problem, raw, covariance, sigmas)
        factors = scale_factors(problem, raw, solver.squares(state.x, sigmas), sigmas, options.loss)
        after, largest = _stepped(solver, state, system, covariance, options)
        settled = np.allclose(common, state.common, rtol=0.02, atol=1e-6) and largest < _STILL
        settled = settled and bool(np.max(np.abs(np.log(factors))) < _STILL)
        state = after._replace(common=0.5 * (common + state.common))
        if settled:
            break
        scales = scales * factors
        sigmas = tuple(sigma * scale for sigma, scale in zip(summary.sigmas, scales))
    costs = [
        losses.total_cost(options.loss, solver.squares(x, sigmas))
        + problem.parameters.prior_cost(x)
        for x in (np.zeros_like(state.x), state.x)
    ]
    if largest > _MOVING:
        message = _moving_still(largest)
        summary = replace(summary, status=NOT_CONVERGED, message=message, settled=False)
    return replace(
        summary,
        x=state.x,
        cost_initial=costs[0],
        cost_final=costs[1],
        sigmas=sigmas,
        scales=tuple(float(s) for s in scales * summary.scales),
        inset_steps=tuple(float(v) for v in state.insets),
        model_errors=in_units(errors, state.errors),
        common=tuple(float(v) for v in state.common),
    )


def _moving_still(largest: float) -> str:
    return (
        f"the weights of detections that are off as a whole did not settle in {_ROUNDS} rounds: "
        f"the last one moved a sensor by {largest:.1f} of its standard deviation; add collections, "
        f"or calibrate without --model_errors auto"
    )


def _first_state(summary: SolverSummary, options: SolverOptions) -> _State:
    return _State(
        summary.x.copy(),
        np.array(summary.inset_steps),
        in_steps(options.model_errors, summary.model_errors),
        np.zeros(len(summary.sigmas)),
    )


def _system(
    solver: Solver, state: _State, sigmas: Sequence[np.ndarray], options: SolverOptions
) -> _System:
    problem = solver.problem
    scalars = scalars_of(solver, state.x, sigmas, options.loss, options.model_errors)
    shares = shares_of(problem, sigmas, state.common)
    equations = solver.equations(state.x, sigmas, options.loss)
    equations = tempered(problem, equations, shares, state.x)
    return _System(
        equations,
        scalars,
        joint_of(problem, equations, scalars, shares, options.error_priors),
    )


def _stepped(
    solver: Solver,
    state: _State,
    system: _System,
    covariance: Covariance,
    options: SolverOptions,
) -> Tuple[_State, float]:
    """Take a Gauss-Newton step of everything; return the largest of the shared, in sigmas."""
    errors, problem = list(options.model_errors), solver.problem
    length = losses.step_length(options.loss)
    scalar_step = system.joint.newton_step()
    step = system.joint.step_of_poses(system.equations, scalar_step)
    shared = np.sqrt(np.maximum(np.diagonal(covariance.shared), 1e-30))
    largest = float(np.max(np.abs(step[: len(shared)]) / shared, initial=0.0))
    borders = [i for i, b in enumerate(problem.residual_blocks) if isinstance(b, BorderBlock)]
    insets = state.insets.copy()
    insets[borders] += length * scalar_step[: len(borders)]
    insets = np.clip(insets, 0.0, MOST_STEPS)
    values = within_reason(errors, state.errors + length * scalar_step[len(borders) :])
    x = state.x + length * step
    poses = problem.poses(x)
    expected = {}
    for i in borders:
        block = problem.residual_blocks[i]
        assert isinstance(block, BorderBlock)
        expected[i] = insets[i] * block.steps_across(poses)
    solver.take_insets(problem.with_insets(expected))
    apply_errors(solver, x, errors, values)
    return _State(x, insets, values, state.common), largest


def _common_parts(
    problem: Problem,
    equations: NormalEquations,
    covariance: Covariance,
    sigmas: Sequence[np.ndarray],
) -> np.ndarray:
    """Return (b,): the standard deviation of the common part of each block, in its unit.

    With noise of single rows only, what a detection's own pose would gain is a chi-square of as
    many degrees of freedom as its rows see, less what the joint solution has fitted to it. A
    common part makes it grow with the number of rows.
    """
    states = covariance.states(problem.dependencies, equations.state_jacobians)
    twist = slice(0, BLOCK_SIZE)
    found: List[float] = []
    for block, part, sigma in zip(problem.residual_blocks, equations.parts, sigmas):
        information, gradient = part.information[:, twist, twist], part.gradient[:, twist]
        chi_square, rank = _own_gain(information, gradient)
        fitted = np.einsum("dij,dji->d", information, states[part.detection][:, twist, twist])
        count = np.bincount(block.detection)[part.detection]
        excess = np.sum(chi_square) + np.sum(np.minimum(fitted, rank)) - np.sum(rank)
        ratio = max(excess, 0.0) / max(np.sum(rank * count), 1e-30)
        found.append(float(np.sqrt(ratio) * np.median(sigma)))
    return np.array(found)


def _own_gain(information: np.ndarray, gradient: np.ndarray) -> Tuple[np.ndarray, np.ndarray]:
    """Return (m,): twice the cost that each detection's own pose saves; and (m,) what it sees."""
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(information, axis1=1, axis2=2), 1e-30))
    scaled = information * scale[:, :, None] * scale[:, None, :]
    values, vectors = np.linalg.eigh(scaled)
    seen = values > _SMALLEST
    along = np.einsum("dij,di->dj", vectors, gradient * scale)
    gain = np.sum(np.where(seen, along**2 / np.where(seen, values, 1.0), 0.0), axis=1)
    return gain, np.sum(seen, axis=1).astype(float)


def covariance_by_detections(
    solver: Solver, summary: SolverSummary, options: SolverOptions
) -> Covariance:
    """Return the covariance of a solution that is weighted by detections."""
    values = in_steps(options.model_errors, summary.model_errors)
    state = _State(summary.x, np.array(summary.inset_steps), values, np.array(summary.common))
    system = _system(solver, state, summary.sigmas, options)
    return Covariance(system.equations).bordered(system.joint)
