"""Waves across the image of a depth camera: where they show, and what they do to the answer.

A wave is the same in all collections, and so in no sigma. It shows within detections: beside the
plane that fits it best, neighbouring points are off together, by more than their noise allows where
each is off by itself. What it does to the answer is seen one step farther, with waves of all
lengths free beside the other numbers, as far as they are usual.
"""

from __future__ import annotations

from typing import Dict, List, NamedTuple, Sequence

import numpy as np

from atom_core.calibration.refine.model_checks import ModelCheck
from atom_core.model.dataset import Dataset
from atom_core.problem.board_errors import SURFACES
from atom_core.problem.model_errors import ErrorPrior, ModelError
from atom_core.problem.problem import Problem
from atom_core.problem.range_fields import DepthWave, DepthWaves, depth_waves
from atom_core.problem.residuals import OrthogonalBlock
from atom_core.solvers import losses
from atom_core.solvers.base import Solver, SolverOptions, SolverSummary
from atom_core.solvers.error_columns import row_weight
from atom_core.solvers.scalar_columns import scalars_of
from atom_core.solvers.shared_equations import inverse, shared_equations

_CELLS = (16, 12)  # of the image, in x and y
_OF_PLANE = 3
_CLEAR = 3.0  # standard deviations
_NO_ERROR_M = 0.001  # as much as the points of a detection may have in common in any case


class Waves(NamedTuple):
    """What the residuals of a depth camera show, in the middle of its detections.

    Attributes:
        size_m: standard deviation of what neighbouring points have in common beside a plane.
        clear: by how many standard deviations that is more than chance.
    """

    size_m: float
    clear: float


def wave_checks(
    dataset: Dataset,
    solver: Solver,
    summary: SolverSummary,
    options: SolverOptions,
    checks: Sequence[ModelCheck],
) -> List[ModelCheck]:
    """Return the depth cameras whose images have waves.

    Args:
        dataset: with the sensors' intrinsics.
        solver: of the problem.
        summary: its solution.
        options: robust loss, and priors of what it has estimated.
        checks: what else the data show: a bent board looks like waves.
    """
    if any(isinstance(error, (*SURFACES, DepthWave)) for error in _all(summary, checks)):
        return []
    found, problem = [], solver.problem
    for block, sigma in zip(problem.residual_blocks, summary.sigmas):
        sensor = dataset.sensors[block.sensor]
        if not isinstance(block, OrthogonalBlock) or sensor.camera is None:
            continue
        waves = depth_waves(block.sensor, sensor.camera)
        seen = seen_waves(problem, summary.x, block, sigma, options.loss, waves[0])
        if seen.clear > _CLEAR and seen.size_m > _NO_ERROR_M:
            found.append(_check(solver, summary, options, block, waves))
    return found


def _all(summary: SolverSummary, checks: Sequence[ModelCheck]) -> List[ModelError]:
    return [*summary.model_errors, *(check.error for check in checks)]


def seen_waves(
    problem: Problem,
    x: np.ndarray,
    block: OrthogonalBlock,
    sigma: np.ndarray,
    loss: str,
    wave: DepthWave,
) -> Waves:
    """Return what the residuals of a depth camera show.

    Args:
        problem: whose block.
        x: the solution.
        block: of the camera.
        sigma: (n,) of the block [m].
        loss: robust loss.
        wave: any one of the camera.
    """
    poses = problem.poses(x)
    residual = block.residuals(poses)
    weight = row_weight(residual, sigma, loss)
    group = block.segment_of_items
    height = _beside_planes(residual[:, 0], block.in_plane(poses), weight, group)
    x_cell, y_cell = (
        np.clip((wave.across(block.on_own_rays, axis) * count).astype(int), 0, count - 1)
        for axis, count in enumerate(_CELLS)
    )
    count, cells = int(group[-1]) + 1, _CELLS[0] * _CELLS[1]
    place = (group * _CELLS[1] + y_cell) * _CELLS[0] + x_cell
    score, information = (
        np.bincount(place, values, count * cells).reshape(count, cells)
        for values in (weight * height, weight)
    )
    used = np.sum(information > 0.0, axis=1)
    freedom = np.maximum(used - _OF_PLANE, 1)
    between = np.sum(score**2 / np.maximum(information, 1e-30), axis=1)
    within = np.bincount(group, weight * height**2) - between
    noise = within / np.maximum(np.bincount(group) - used, 1)
    excess = between / np.maximum(noise, 1e-30) - freedom
    variance = np.median(noise * excess / information.sum(axis=1))
    return Waves(
        float(np.sqrt(max(variance, 0.0))), float(np.median(excess / np.sqrt(2.0 * freedom)))
    )


def _beside_planes(
    height: np.ndarray, in_plane: np.ndarray, weight: np.ndarray, group: np.ndarray
) -> np.ndarray:
    """Return heights (n,) beside the plane that fits best those of their group."""
    columns = np.ones(len(height)), in_plane[:, 0], in_plane[:, 1]
    weighted = [weight * column for column in columns]
    normal = np.array([[np.bincount(group, w * column) for column in columns] for w in weighted])
    slope = np.array([np.bincount(group, w * height) for w in weighted])
    plane = np.einsum("gij,jg->ig", np.linalg.pinv(np.moveaxis(normal, 2, 0)), slope)
    return height - sum(part[group] * column for part, column in zip(plane, columns))


def _check(
    solver: Solver,
    summary: SolverSummary,
    options: SolverOptions,
    block: OrthogonalBlock,
    waves: Sequence[DepthWave],
) -> ModelCheck:
    """Return what one step with all waves of a camera beside the other numbers would change."""
    problem, x, sigmas, loss = solver.problem, summary.x, summary.sigmas, options.loss
    errors: List[ModelError] = [*summary.model_errors, *waves]
    scalars = scalars_of(solver, x, sigmas, loss, errors)
    priors: Dict[ModelError, ErrorPrior] = dict(options.error_priors)
    priors.update({wave: ErrorPrior(wave.usual) for wave in waves})
    common = summary.common or [0.0] * len(problem.residual_blocks)
    equations = shared_equations(
        problem, solver.equations(x, sigmas, loss), scalars, sigmas, priors, common
    )
    gradient, place = equations.total_gradient, equations.place
    covariance = inverse(equations.total)
    step = -covariance @ gradient
    mine = [place[wave] for wave in waves if wave in place]
    heights = np.array([w.step * w.share(block.on_own_rays) for w in waves if w in place])
    second = heights @ heights.T / heights.shape[1]  # (k, k) mean products over the points
    share = np.sqrt(step[mine] @ second @ step[mine])
    sigma = np.sqrt(np.trace(second @ covariance[np.ix_(mine, mine)]))
    length = losses.step_length(loss)
    return ModelCheck(
        DepthWaves(block.sensor),
        float(length * share),
        float(length * sigma),
        float(-step @ gradient * length),
        length * step[: equations.shared],
        (),
    )
