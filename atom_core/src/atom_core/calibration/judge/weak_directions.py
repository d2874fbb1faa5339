"""Directions that the data leave open, found in the covariance and named by their parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, List, Optional, Sequence, Tuple

import numpy as np

from atom_core.calibration.judge.reasons import (
    Boards,
    Solution,
    intrinsics_reason,
    is_spin_axis,
    parallel_boards,
    reason,
    reason_in_collection,
)
from atom_core.model.transforms import Edge, chain_transform
from atom_core.problem.blocks import (
    ADDITIONAL_TF,
    BLOCK_SIZE,
    ROTATION,
    TRANSLATION,
    PoseBlock,
)
from atom_core.problem.camera_blocks import CameraBlock
from atom_core.problem.joint_blocks import JointBiasBlock, JointBlock
from atom_core.problem.parameters import Component, Parameters
from atom_core.problem.problem import Problem
from atom_core.solvers.covariance import LARGEST_SIGMA, Covariance

_NAMED_SHARE = 0.5  # parameters are named when they move at least this part of the largest
_MOST_REPORTED, _MOST_NAMED = 12, 4  # directions; collections in which one is open


@dataclass(frozen=True)
class WeakDirection:
    """One direction in the space of the parameters.

    Attributes:
        parameters: the named ones move together along it, e.g. ``rgb_1 z``.
        sigma: predicted standard deviation of the one that moves most.
        unit: m, rad, or px and 1 of intrinsics.
        why: one sentence.
    """

    parameters: Tuple[str, ...]
    sigma: float
    unit: str
    why: str


def edge_covariance(block: PoseBlock, x: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return the (6, 6) covariance of rotation [rad] and translation [m] in the parent's axes.

    Args:
        block: the edge's parameter block.
        x: (6,) its numbers at the solution.
        covariance: (6, 6) of its numbers.
    """
    to_parent = block.to_parent_axes(x)
    return to_parent @ covariance @ to_parent.T


def weak_model_errors(covariance: Covariance, limit: float) -> List[WeakDirection]:
    """Return the model errors whose predicted sigma exceeds the limit, in m or as a part."""
    return [
        WeakDirection(
            (error.title,),
            min(sigma, LARGEST_SIGMA),
            error.unit,
            f"the data hardly tell the {error.title} from other poses; collect boards at other "
            f"distances and angles, or leave it out of {error.option}",
        )
        for error, sigma in covariance.error_sigmas.items()
        if sigma > limit
    ]


def weak_directions(
    solution: Solution, covariance: Covariance, limit_m: float, limit_rad: float
) -> List[WeakDirection]:
    """Return the undetermined directions: of the shared parameters, weakest first.

    A parameter is undetermined when its predicted sigma exceeds the limit. The directions that
    make it so are the leading eigenvectors of the covariance in units of the limits. Where the
    boards show why a sensor's are open, they are named along and about the boards' normal.
    Then the weakest one of each transform that has a value in each collection. Boards may be open.
    """
    shared = _weak_shared(solution, covariance, limit_m, limit_rad)
    return shared + _weak_in_collections(solution, covariance, limit_m, limit_rad)


def _weak_shared(
    solution: Solution, covariance: Covariance, limit_m: float, limit_rad: float
) -> List[WeakDirection]:
    parameters, x = solution.problem.parameters, solution.x
    blocks = parameters.shared_blocks
    if not blocks:
        return []
    limits = np.where(np.concatenate([b.is_angle for b in blocks]), limit_rad, limit_m)
    scaled = parent_axes_covariance(parameters, x, covariance.shared) / limits[:, None] / limits
    scaled = _capped(scaled, LARGEST_SIGMA / limits)
    values, vectors = np.linalg.eigh((scaled + scaled.T) / 2.0)
    left = np.diagonal(scaled).copy()
    spreads: List[np.ndarray] = []
    for value, vector in zip(values[::-1], vectors.T[::-1]):
        if np.max(left) <= 1.0 or value <= 1.0 or len(spreads) == _MOST_REPORTED:
            break
        spreads.append(np.sqrt(value) * vector)
        left = left - value * vector**2
    return _described(solution, scaled, spreads, limits)


def transforms_by_collection(problem: Problem) -> Dict[Edge, List[int]]:
    """Return the blocks of each additional tf that has a value in each collection.

    Those of collections in which nothing hangs on it are left out, unless nothing ever does.
    """
    edges: Dict[Edge, List[int]] = {}
    for i, block in problem.parameters.pose_blocks():
        if block.kind == ADDITIONAL_TF and block.collection is not None:
            edges.setdefault(block.edge, []).append(i)
    on_chains = set(problem.chains.block.ravel().tolist())
    return {edge: [i for i in own if i in on_chains] or own for edge, own in edges.items()}


def _weak_in_collections(
    solution: Solution, covariance: Covariance, limit_m: float, limit_rad: float
) -> List[WeakDirection]:
    parameters, found = solution.problem.parameters, []
    limits = np.tile(np.repeat([limit_rad, limit_m], BLOCK_SIZE // 2), len(parameters.blocks))
    for blocks in transforms_by_collection(solution.problem).values():
        spreads = {i: _open_spread(solution, covariance, limits, i) for i in blocks}
        far = {i: spread for i, spread in spreads.items() if spread is not None}
        if far:
            worst = max(far, key=lambda i: float(np.max(np.abs(far[i]))))
            where = _in_collections([str(parameters.blocks[i].collection) for i in far], blocks)
            because = reason_in_collection(solution.problem, worst)
            found.append(_describe(solution, far[worst], limits, because, where))
    return found


def _open_spread(
    solution: Solution, covariance: Covariance, limits: np.ndarray, block: int
) -> Optional[np.ndarray]:
    """Return one sigma (n,) along a pose block's weakest direction, None where it is known."""
    parameters = solution.problem.parameters
    pose, at = parameters.blocks[block], parameters.slice_of(block)
    assert isinstance(pose, PoseBlock)
    scaled = edge_covariance(pose, solution.x[at], covariance.block(block))
    scaled = _capped(scaled / limits[at, None] / limits[at], LARGEST_SIGMA / limits[at])
    if np.max(np.diagonal(scaled)) <= 1.0:
        return None
    values, vectors = np.linalg.eigh((scaled + scaled.T) / 2.0)
    spread = np.zeros(parameters.size)
    spread[at] = np.sqrt(values[-1]) * vectors[:, -1]
    return spread


def _in_collections(keys: Sequence[str], blocks: Sequence[int]) -> str:
    """Return in which of a transform's collections it is open, in words."""
    if len(keys) == len(blocks) > 1:
        return f" in all {len(keys)} collections"
    more = f" and {len(keys) - _MOST_NAMED} more" if len(keys) > _MOST_NAMED else ""
    return f" in collection {', '.join(keys[:_MOST_NAMED])}{more}"


def _capped(covariance: np.ndarray, largest: np.ndarray) -> np.ndarray:
    """Return a covariance (n, n) with no sigma above the largest (n,), correlations kept.

    What nothing sees has a variance beyond which all others are rounding to an eigensolver.
    """
    sigma = np.sqrt(np.maximum(np.diagonal(covariance), 0.0))
    shrink = np.minimum(1.0, largest / np.maximum(sigma, 1e-300))
    return covariance * shrink[:, None] * shrink


def _described(
    solution: Solution, scaled: np.ndarray, spreads: Sequence[np.ndarray], limits: np.ndarray
) -> List[WeakDirection]:
    found: List[WeakDirection] = []
    by_boards: Dict[int, Optional[Boards]] = {}
    for spread in spreads:
        moving = _moving(solution, spread)
        block = moving[0]
        if len(moving) == 1 and block not in by_boards:
            by_boards[block] = boards = parallel_boards(solution, block)
            if boards is not None:
                found += _along_boards(solution, block, boards, scaled, limits)
        if len(moving) > 1 or by_boards[block] is None:
            found.append(_describe(solution, spread, limits, None))
    return found


def _along_boards(
    solution: Solution, block: int, boards: Boards, scaled: np.ndarray, limits: np.ndarray
) -> List[WeakDirection]:
    """Return the two shifts along parallel boards and the turn about their normal."""
    parent_R_world = _world_R_parent(solution, block).T
    level = np.cross(boards.normal, [0.0, 0.0, 1.0])
    if np.linalg.norm(level) < 0.1:
        level = np.cross(boards.normal, [1.0, 0.0, 0.0])
    level /= np.linalg.norm(level)
    found = []
    columns = solution.problem.parameters.columns(np.array(block))
    for axis, part in (
        (level, TRANSLATION),
        (np.cross(boards.normal, level), TRANSLATION),
        (boards.normal, ROTATION),
    ):
        at = columns[part]
        direction = parent_R_world @ axis
        variance = float(direction @ scaled[np.ix_(at, at)] @ direction)
        spread = np.zeros(len(scaled))
        spread[at] = np.sqrt(max(variance, 0.0)) * direction
        found.append(_describe(solution, spread, limits, boards.words))
    return found


def parent_axes_covariance(parameters: Parameters, x: np.ndarray, shared: np.ndarray) -> np.ndarray:
    """Return the covariance (6 s, 6 s) of the shared blocks, poses in their parents' axes."""
    to_parent = np.eye(len(shared))
    for i, block in parameters.pose_blocks():
        if block.collection is None:
            at = parameters.slice_of(i)
            to_parent[at, at] = block.to_parent_axes(x[at])
    return to_parent @ shared @ to_parent.T


def largest_variances(solution: Solution, covariance: Covariance) -> Dict[str, float]:
    """Return the variance of each number that a weak direction may name, poses in parents' axes.

    Of numbers of collections, which have one name, the largest.
    """
    problem, x = solution.problem, solution.x
    parameters = problem.parameters
    shared = np.diagonal(parent_axes_covariance(parameters, x, covariance.shared))
    found = {parameters.component(i).name: float(v) for i, v in enumerate(shared)}
    for i in (i for blocks in transforms_by_collection(problem).values() for i in blocks):
        at, pose = parameters.slice_of(i), parameters.blocks[i]
        assert isinstance(pose, PoseBlock)
        own = np.diagonal(edge_covariance(pose, x[at], covariance.block(i)))
        for place, variance in enumerate(own, at.start):
            name = parameters.component(place).name
            found[name] = max(found.get(name, 0.0), float(variance))
    return found


def _named(spread: np.ndarray) -> np.ndarray:
    """Return the indices of the parameters that move most."""
    return np.flatnonzero(np.abs(spread) >= _NAMED_SHARE * np.max(np.abs(spread)))


def _moving(solution: Solution, spread: np.ndarray) -> List[int]:
    """Return the blocks of the parameters that move most."""
    parameters = solution.problem.parameters
    return sorted({parameters.component(int(i)).block for i in _named(spread)})


def _describe(
    solution: Solution,
    spread: np.ndarray,
    limits: np.ndarray,
    known_reason: Optional[str],
    where: str = "",
) -> WeakDirection:
    """Name a direction; ``spread`` is one sigma along it, in units of the limits."""
    parameters, moving = solution.problem.parameters, _moving(solution, spread)
    names = tuple(parameters.component(int(i)).name for i in _named(spread))
    largest = int(np.argmax(np.abs(spread)))
    strongest = parameters.component(largest)
    block, unit = parameters.blocks[strongest.block], strongest.unit
    sigma = min(float(abs(spread[largest]) * limits[largest]), LARGEST_SIGMA)
    if isinstance(block, CameraBlock):
        sigma = min(sigma * float(block.scales[strongest.place]), LARGEST_SIGMA)
        why = f"the data hardly change when {', '.join(names)} change{'' if names[1:] else 's'}"
        because = intrinsics_reason(solution, strongest.block)
        return WeakDirection(names, sigma, unit, f"{why}: {because}" if because else why)
    axis = _world_direction(solution, spread, strongest)
    why = f"the data hardly change when {_motion(solution, moving, unit, axis)}{where}"
    cameras = [i for i in moving if isinstance(parameters.blocks[i], CameraBlock)]
    because = known_reason or (intrinsics_reason(solution, cameras[0]) if cameras else None)
    because = because or reason(solution, [i for i in moving if i not in cameras], axis)
    return WeakDirection(names, sigma, unit, f"{why}: {because}" if because else why)


def _motion(solution: Solution, moving: Sequence[int], unit: str, axis: np.ndarray) -> str:
    """Return who moves how, in words."""
    blocks = solution.problem.parameters.blocks
    who = sorted({blocks[i].title for i in moving})
    verb, preposition = ("turn", "about") if unit == "rad" else ("shift", "along")
    direction = (
        f"({', '.join(f'{v:.2f}' for v in axis.round(2) + 0.0)}) of {solution.dataset.world}"
    )
    if len(who) > 1:
        return f"{', '.join(who)} {verb} {preposition} {direction} together"
    if unit == "rad" and is_spin_axis(solution, moving[0], axis):
        direction = f"its spin axis, {direction}"
    return f"{who[0]} {verb}s {preposition} {direction}"


def _world_R_parent(solution: Solution, block: int) -> np.ndarray:
    dataset, owner = solution.dataset, solution.problem.parameters.blocks[block]
    chain = dataset.graph.chain(dataset.world, owner.edge.parent)
    key = next(iter(dataset.collections)) if owner.collection is None else owner.collection
    collection = dataset.collections[key]
    return chain_transform(chain, collection.transforms)[:3, :3]


def _world_direction(solution: Solution, spread: np.ndarray, strongest: Component) -> np.ndarray:
    """Return the unit direction (3,) of the strongest part in world."""
    parameters, index = solution.problem.parameters, strongest.block
    block, at = parameters.blocks[index], parameters.slice_of(index)
    part = ROTATION if block.is_angle[strongest.place] else TRANSLATION
    in_parent = spread[at][part]
    if isinstance(block, JointBlock):
        only = np.zeros(BLOCK_SIZE)
        only[part] = in_parent
        in_parent = (block.twist_jacobian(solution.x[at]) @ only)[part]
        if isinstance(block, JointBiasBlock):  # it stands behind the origin
            in_parent = solution.dataset.joint(block.joint).origin[:3, :3] @ in_parent
    direction = _world_R_parent(solution, index) @ in_parent
    direction = direction / np.linalg.norm(direction)
    return direction * np.sign(direction[np.argmax(np.abs(direction))])
