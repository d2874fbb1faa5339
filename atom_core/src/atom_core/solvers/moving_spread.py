"""How far moving parts are off from collection to collection: their spread, beside the solution.

Where the part is in each collection, and how uncertain that is, given the spread, with all other
numbers free beside it; then the spread given these, in turns: the variance is the sum of squared
deviations over how many of them are told (MacKay, "Bayesian interpolation", 1992; the same fixed
point as that of expectation maximisation, in fewer rounds). The rows are linearised at the
solution; whoever calls solves anew and calls again.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Dict, List, Mapping, Sequence, Tuple

import numpy as np

from atom_core.model.transforms import Edge
from atom_core.problem.blocks import BLOCK_SIZE, ROTATION, TRANSLATION
from atom_core.problem.moving_blocks import MovingBlock, MovingPart
from atom_core.problem.problem import Problem
from atom_core.solvers import losses
from atom_core.solvers.base import Solver
from atom_core.solvers.covariance import Covariance
from atom_core.solvers.normal_equations import (
    DetectionParts,
    NormalEquations,
    assembled,
    least_damped,
)

LEAST_M, LEAST_RAD = 1e-5, float(np.radians(1e-3))  # a part is not exacter than that
_ROUNDS, _STILL = 300, 1e-3
_FAR = 12.0  # times the square in the middle: so far are three of a million by chance
_LEAST_MIDDLE, _FACTORS = 0.01, (0.3, 3.0)


Parts = Mapping[Edge, MovingPart]


def moving_blocks(problem: Problem) -> Dict[Edge, List[int]]:
    """Return the indices of the blocks of each moving part."""
    found: Dict[Edge, List[int]] = {}
    for i, block in enumerate(problem.parameters.blocks):
        if isinstance(block, MovingBlock):
            found.setdefault(block.edge, []).append(i)
    return found


def estimated_spreads(
    solver: Solver, x: np.ndarray, sigmas: Sequence[np.ndarray], loss: str, parts: Parts
) -> Parts:
    """Return moving parts with their spread estimated anew.

    Args:
        solver: of a problem with the parts' blocks.
        x: its solution with the spreads as they are.
        sigmas: for each residual block, (n,) in its unit.
        loss: robust loss.
        parts: those whose spread is estimated; the others stay as they are.
    """
    parameters, blocks = solver.problem.parameters, moving_blocks(solver.problem)
    equations = _as_if_gaussian(solver.problem, solver.equations(x, sigmas, loss), loss)
    off = parameters.by_block(x) - parameters.prior_mean
    weight, now = parameters.prior_weight.copy(), dict(parts)
    for _ in range(_ROUNDS):
        system = _with_weights(equations, weight, off)
        right, factor = (-system.gradient_shared, -system.gradient_local), least_damped(system)
        if factor is None:
            break
        step = system.layout.join(*factor.solve(*right))
        deviation, covariance = off + parameters.by_block(step), Covariance(system)
        before = dict(now)
        for edge, part in before.items():
            mine = np.array(blocks[edge])
            variance = np.diagonal(covariance.pairs(mine, mine), axis1=1, axis2=2)
            keys = [str(parameters.blocks[i].collection) for i in mine]
            now[edge] = _estimated(part, keys, deviation[mine], variance)
            weight[mine] = [_weight(now[edge].sigmas(key)) for key in keys]
        if all(is_near(now[edge], part, _STILL) for edge, part in before.items()):
            break
    return now


def is_near(part: MovingPart, other: MovingPart, share: float) -> bool:
    """Tell whether two spreads differ by less than a share, or by less than matters."""
    return (
        abs(part.sigma_m - other.sigma_m) < max(share * part.sigma_m, 0.1 * LEAST_M)
        and abs(part.sigma_rad - other.sigma_rad) < max(share * part.sigma_rad, 0.1 * LEAST_RAD)
        and part.far == other.far
    )


def _as_if_gaussian(problem: Problem, equations: NormalEquations, loss: str) -> NormalEquations:
    """Return the equations of the data alone, as they were without a robust loss.

    The weights of a robust loss say less than the residuals tell, and more of the forces is lost:
    what is expected of the moving parts would win against them.
    """
    parts = []
    for block, part in zip(problem.residual_blocks, equations.parts):
        more, force = losses.told(loss, block.dimension)
        parts.append(DetectionParts(part.detection, more * part.information, force * part.gradient))
    return assembled(problem, equations.layout, equations.state_jacobians, parts)


def _with_weights(
    equations: NormalEquations, weight: np.ndarray, off: np.ndarray
) -> NormalEquations:
    """Return the equations of the data together with what is expected.

    Args:
        equations: of the data alone, at the solution.
        weight: (b, 6) one over the variances.
        off: (b, 6) how far the numbers are from what is expected.
    """
    layout, local, shared = equations.layout, equations.local.copy(), equations.shared.copy()
    of_shared, of_local = layout.split(weight.ravel())
    slope_shared, slope_local = layout.split((weight * off).ravel())
    local[:, range(local.shape[1]), range(local.shape[1])] += of_local
    shared[range(len(shared)), range(len(shared))] += of_shared
    return replace(
        equations,
        shared=shared,
        local=local,
        gradient_shared=equations.gradient_shared + slope_shared,
        gradient_local=equations.gradient_local + slope_local,
    )


def _estimated(
    part: MovingPart, keys: Sequence[str], deviation: np.ndarray, variance: np.ndarray
) -> MovingPart:
    """Return a part with the spread of its deviations (n, 6) with their variances.

    A collection is far where a deviation is far beyond those in the middle of all.
    """
    was_far = np.array([key in part.far for key in keys])
    parts, far = [], np.zeros(len(keys), dtype=bool)
    for axes, sigma in ((TRANSLATION, part.sigma_m), (ROTATION, part.sigma_rad)):
        square, own = np.mean(deviation[:, axes] ** 2, axis=1), np.mean(variance[:, axes], axis=1)
        # What is expected near zero has been drawn there already, as far as it is not told.
        left = np.maximum(sigma**2 - own, 1e-9 * sigma**2)
        relative = square / np.where(was_far, sigma**2 + own, left)
        far |= relative > _FAR * max(float(np.median(relative)), _LEAST_MIDDLE)
        parts.append((sigma, square, left))
    shift, turn = (
        sigma * np.clip(np.sqrt(np.sum(square[~far]) / np.sum(left[~far])), *_FACTORS)
        for sigma, square, left in parts
    )
    return replace(
        part,
        sigma_m=max(float(shift), LEAST_M),
        sigma_rad=max(float(turn), LEAST_RAD),
        far=frozenset(np.array(keys)[far]),
    )


def _weight(sigmas: Tuple[float, float]) -> np.ndarray:
    weight = np.empty(BLOCK_SIZE)
    weight[TRANSLATION], weight[ROTATION] = sigmas[0] ** -2.0, sigmas[1] ** -2.0
    return weight
