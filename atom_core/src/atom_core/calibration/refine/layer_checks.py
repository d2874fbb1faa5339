"""Whether the layers of a 3D LiDAR read long or short by amounts of their own: one test for all.

Each layer has a column of its own, and each row belongs to one layer only: sums over the rows are
all that is needed. Poses and an offset that is common to the layers are free beside them. What the
collections say of the layers is compared from collection to collection: a product of two of them
is zero in the mean where nothing is wrong, however the noise within one may be (a U-statistic).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.calibration.refine.model_checks import ModelCheck
from atom_core.problem.blocks import BLOCK_SIZE
from atom_core.problem.problem import Problem
from atom_core.problem.range_fields import LayerOffset, LayerOffsets
from atom_core.problem.residuals import OrthogonalBlock
from atom_core.solvers import losses
from atom_core.solvers.base import Solver, SolverSummary
from atom_core.solvers.detection_columns import DetectionColumns, collection_columns
from atom_core.solvers.normal_equations import NormalEquations
from atom_core.solvers.scalar_columns import ScalarPart, Scalars
from atom_core.solvers.shared_equations import SharedEquations, inverse, shares_of, tempered

_FEWEST_LAYERS = 4
_FEWEST = 6  # collections
_CLEAR, _HINT = 6.0, 2.0  # standard deviations of the statistic
_LEAST_M = 0.002  # less is nobody's concern
_POORLY_SEEN = 9.0  # times the variance in the middle of the layers
_SEEN = 0.02  # part of its information that other numbers must leave a direction


def layer_checks(
    solver: Solver,
    summary: SolverSummary,
    loss: str,
    shared: SharedEquations,
    layers: Sequence[LayerSums],
    others: Sequence[ModelCheck],
) -> List[ModelCheck]:
    """Return the LiDARs whose layers differ, where no other error explains as much.

    Args:
        solver: of the problem.
        summary: its solution.
        loss: robust loss.
        shared: what each collection says of the shared numbers.
        layers: of the LiDARs whose layers are not estimated.
        others: the checks of single errors.
    """
    problem = solver.problem
    if len(shared.collections) < _FEWEST:
        return []
    explained, found = max((check.gain for check in others), default=0.0), []
    for sums in layers:
        if _hint(problem, sums) < _HINT:
            continue
        equations = _equations(solver, summary, loss)
        check = _judged(problem, equations, shared, sums, losses.step_length(loss))
        if check is not None and check.gain > explained:
            found.append(check)
    return sorted(found, key=lambda check: -check.gain)


def _hint(problem: Problem, sums: LayerSums) -> float:
    """Return the statistic as if poses did not follow: far from zero where layers differ."""
    _, collection = np.unique([key.collection for key in problem.detections], return_inverse=True)
    slopes = np.zeros((collection.max() + 1, sums.slope.shape[1]))
    np.add.at(slopes, collection, sums.slope)
    scaled = slopes / np.sqrt(np.maximum(sums.curvature.sum(axis=0), 1e-30))
    return _clearness(scaled, scaled)


def _equations(solver: Solver, summary: SolverSummary, loss: str) -> NormalEquations:
    equations = solver.equations(summary.x, summary.sigmas, loss)
    if not any(summary.common):
        return equations
    shares = shares_of(solver.problem, summary.sigmas, summary.common)
    return tempered(solver.problem, equations, shares, summary.x)


class LayerSums(NamedTuple):
    """What the points of a LiDAR on boards say of its layers, by detection d and layer r [m].

    Attributes:
        sensor: which.
        curvature, slope: (d, r).
        by_twist: (d, r, 6) what the layers and the detections' poses have in common.
    """

    sensor: str
    curvature: np.ndarray
    slope: np.ndarray
    by_twist: np.ndarray


def layer_sums(
    problem: Problem, scalars: Scalars, shares: Sequence[np.ndarray]
) -> Tuple[LayerSums, ...]:
    """Return the sums of the LiDARs that have enough layers.

    Args:
        problem: whose rows.
        scalars: the columns beside the poses, those of layers among them.
        shares: for each residual block, (m,) the part of its weight that a detection has.
    """
    found = []
    for part in scalars.parts:
        block = problem.residual_blocks[part.block]
        errors = [scalars.error(number) for number in part.columns]
        mine = [k for k, error in enumerate(errors) if isinstance(error, LayerOffset)]
        if len(mine) >= _FEWEST_LAYERS and isinstance(block, OrthogonalBlock):
            sums = _sums(part, mine, shares[part.block], len(problem.detections))
            found.append(LayerSums(block.sensor, *sums))
    return tuple(found)


def _sums(
    part: ScalarPart, mine: Sequence[int], share: np.ndarray, detections: int
) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return curvature, slope and by_twist of some columns of a residual block."""
    count = len(mine)
    curvature, slope = np.zeros((detections, count)), np.zeros((detections, count))
    by_twist = np.zeros((detections, count, BLOCK_SIZE))
    by_step = share[:, None] / LayerOffset.step
    curvature[part.detection] = part.information[:, mine, mine] * by_step / LayerOffset.step
    slope[part.detection] = part.gradient[:, mine] * by_step
    common = np.swapaxes(part.by_state, 1, 2)[:, mine]
    by_twist[part.detection] = common * by_step[:, None]
    return curvature, slope, by_twist


@dataclass(frozen=True)
class _Layers:
    """What g collections say of r layers, the shared numbers following them.

    Attributes:
        information: (g, r, r).
        slope: (g, r), a common offset taken out.
        total: (r, r) of all, everything else eliminated.
        gains: (s, r) how the shared numbers follow.
        mixing: (r, r) takes a common offset out of slopes.
    """

    information: np.ndarray
    slope: np.ndarray
    total: np.ndarray
    gains: np.ndarray
    mixing: np.ndarray


def _layers(
    problem: Problem, equations: NormalEquations, shared: SharedEquations, sums: LayerSums
) -> _Layers:
    columns = DetectionColumns(sums.curvature, sums.slope, sums.by_twist)
    found = collection_columns(problem, equations, shared.collections, columns)
    return _without_others(shared, BLOCK_SIZE * shared.blocks, *found)


def _without_others(
    shared: SharedEquations,
    size: int,
    cross: np.ndarray,
    information: np.ndarray,
    slope: np.ndarray,
) -> _Layers:
    """Return the layers' equations, shared numbers and the common offset eliminated."""
    gains = inverse(shared.total[:size, :size]) @ cross.sum(axis=0)
    of_all = information.sum(axis=0) - cross.sum(axis=0).T @ gains
    slope = slope - shared.gradient[:, :size] @ gains
    followed = np.einsum("gsr,st->grt", cross, gains)
    information = information - followed - np.swapaxes(followed, 1, 2)
    for c, part in enumerate(shared.parts):
        own = part.numbers < size
        followed_by = gains[part.numbers[own]]
        information[c] += followed_by.T @ part.information[np.ix_(own, own)] @ followed_by
    common = of_all.sum(axis=1)
    mixing = np.eye(len(of_all)) - np.outer(np.ones(len(of_all)), common) / max(common.sum(), 1e-30)
    left = of_all - np.outer(common, common) / max(common.sum(), 1e-30)
    return _Layers(information, slope @ mixing, left, gains, mixing)


def _judged(
    problem: Problem,
    equations: NormalEquations,
    shared: SharedEquations,
    sums: LayerSums,
    length: float,
) -> Optional[ModelCheck]:
    """Return the check of a LiDAR whose layers differ, else None."""
    layers = _layers(problem, equations, shared, sums)
    scale = np.sqrt(np.maximum(np.diagonal(layers.total), 1e-30))
    values, vectors = np.linalg.eigh(layers.total / scale[:, None] / scale)
    seen = values > _SEEN
    if np.sum(seen) < _FEWEST_LAYERS - 1:
        return None
    pseudo = (vectors[:, seen] / values[seen]) @ vectors[:, seen].T / scale[:, None] / scale
    value = -pseudo @ layers.slope.sum(axis=0)
    fitted = np.einsum("grs,s->gr", layers.information, value) @ layers.mixing
    left = layers.slope + fitted
    size, sigma = _size(pseudo, value, left)
    gain = float(value @ layers.total @ value) * length
    if _clearness(layers.slope / scale, left / scale) < _CLEAR or length * size < _LEAST_M:
        return None
    moves = np.zeros(shared.shared)
    moves[: len(layers.gains)] = -layers.gains @ (layers.mixing @ value) * length
    return ModelCheck(LayerOffsets(sums.sensor), length * size, length * sigma, gain, moves, ())


def _clearness(slopes: np.ndarray, left: np.ndarray) -> float:
    """Return the sum of products of different collections, in its standard deviations.

    Args:
        slopes: (g, r) what the collections say.
        left: (g, r) without what all of them say.
    """

    def products(of: np.ndarray) -> np.ndarray:
        each = of @ of.T
        np.fill_diagonal(each, 0.0)
        return each

    return float(np.sum(products(slopes)) / np.sqrt(2.0 * np.sum(products(left) ** 2) + 1e-30))


def _size(pseudo: np.ndarray, value: np.ndarray, left: np.ndarray) -> Tuple[float, float]:
    """Return the root of the mean squared offset, and its standard deviation, of known layers [m].

    Args:
        pseudo: (r, r) inverse of the layers' information.
        value: (r,) their offsets.
        left: (g, r) what collections say differently.
    """
    variance = pseudo @ (left.T @ left) @ pseudo
    each = np.diagonal(variance)
    known = np.flatnonzero(each <= _POORLY_SEEN * np.median(each))
    variance, value = variance[np.ix_(known, known)], value[known]
    square = float(np.mean(value**2) - np.mean(each[known]))
    spread = 2.0 * np.sum(variance**2) + 4.0 * float(value @ variance @ value)
    size = float(np.sqrt(max(square, 1e-12)))
    return size, float(np.sqrt(spread)) / len(value) / (2.0 * size)
