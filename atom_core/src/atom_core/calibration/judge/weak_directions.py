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
)
from atom_core.geometry import se3
from atom_core.model.transforms import chain_transform
from atom_core.problem.camera_blocks import CameraNumbers
from atom_core.problem.joint_blocks import BiasNumbers
from atom_core.problem.parameters import ParameterBlock
from atom_core.solvers.covariance import Covariance

_NAMED_SHARE = 0.5  # parameters are named when they move at least this part of the largest
_MOST_REPORTED = 12
_LARGEST_SIGMA = 1e6  # what is not seen at all is reported with this (JSON has no infinity)


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


def edge_covariance(block: ParameterBlock, x: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Return the (6, 6) covariance of rotation [rad] and translation [m] in the parent's axes.

    Args:
        block: the parameter block.
        x: (6,) its numbers at the solution.
        covariance: (6, 6) of its numbers.
    """
    rotation = block.initial[:3, :3] @ se3.rotation_from_rotation_vector(x[:3])
    to_parent = np.eye(6)
    to_parent[:3, :3] = rotation @ se3.right_jacobian(x[:3])
    return to_parent @ covariance @ to_parent.T


def weak_range_offsets(covariance: Covariance, limit_m: float) -> List[WeakDirection]:
    """Return the range offsets whose predicted sigma exceeds the limit."""
    return [
        WeakDirection(
            (f"{sensor} range offset",),
            min(sigma, _LARGEST_SIGMA),
            "m",
            f"the data hardly tell an offset of the ranges of {sensor} from a shift of the sensor; "
            f"collect boards at other distances and angles, or leave it out of --range_offset",
        )
        for sensor, sigma in covariance.range_offset_sigmas_m.items()
        if sigma > limit_m
    ]


def weak_directions(
    solution: Solution, covariance: Covariance, limit_m: float, limit_rad: float
) -> List[WeakDirection]:
    """Return the undetermined directions of the shared parameters, weakest first.

    A parameter is undetermined when its predicted sigma exceeds the limit. The directions that
    make it so are the leading eigenvectors of the covariance in units of the limits. Where the
    boards show why a sensor's are open, they are named along and about the boards' normal.
    """
    parameters, x = solution.problem.parameters, solution.x
    blocks = parameters.blocks[: parameters.shared_count]
    if not blocks:
        return []
    of_pose, of_camera = [limit_rad] * 3 + [limit_m] * 3, [limit_rad] * 6
    limits = np.concatenate([of_camera if _is_camera(b) else of_pose for b in blocks])
    scaled = _in_parent_axes(blocks, x, covariance.shared) / limits[:, None] / limits
    values, vectors = np.linalg.eigh((scaled + scaled.T) / 2.0)
    left = np.diagonal(scaled).copy()
    spreads: List[np.ndarray] = []
    for value, vector in zip(values[::-1], vectors.T[::-1]):
        if np.max(left) <= 1.0 or value <= 1.0 or len(spreads) == _MOST_REPORTED:
            break
        spreads.append(np.sqrt(value) * vector)
        left = left - value * vector**2
    return _described(solution, scaled, spreads, limits)


def _is_camera(block: ParameterBlock) -> bool:
    return isinstance(block.numbers, CameraNumbers)


def _described(
    solution: Solution, scaled: np.ndarray, spreads: Sequence[np.ndarray], limits: np.ndarray
) -> List[WeakDirection]:
    found: List[WeakDirection] = []
    by_boards: Dict[int, Optional[Boards]] = {}
    for spread in spreads:
        moving = sorted({int(i) // 6 for i in _named(spread)})
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
    for axis, start in ((level, 3), (np.cross(boards.normal, level), 3), (boards.normal, 0)):
        at = 6 * block + start + np.arange(3)
        direction = parent_R_world @ axis
        variance = float(direction @ scaled[np.ix_(at, at)] @ direction)
        spread = np.zeros(len(scaled))
        spread[at] = np.sqrt(max(variance, 0.0)) * direction
        found.append(_describe(solution, spread, limits, boards.words))
    return found


def _in_parent_axes(
    blocks: Sequence[ParameterBlock], x: np.ndarray, shared: np.ndarray
) -> np.ndarray:
    to_parent = np.eye(len(shared))
    for i, block in enumerate(blocks):
        if block.numbers is not None:
            continue
        at = slice(6 * i, 6 * i + 3)
        steps = x[at]
        rotation = block.initial[:3, :3] @ se3.rotation_from_rotation_vector(steps)
        to_parent[at, at] = rotation @ se3.right_jacobian(steps)
    return to_parent @ shared @ to_parent.T


def _named(spread: np.ndarray) -> np.ndarray:
    """Return the indices of the parameters that move most."""
    return np.flatnonzero(np.abs(spread) >= _NAMED_SHARE * np.max(np.abs(spread)))


def _describe(
    solution: Solution, spread: np.ndarray, limits: np.ndarray, known_reason: Optional[str]
) -> WeakDirection:
    """Name a direction; ``spread`` is one sigma along it, in units of the limits."""
    blocks = solution.problem.parameters.blocks
    largest, named = int(np.argmax(np.abs(spread))), _named(spread)
    names = tuple(f"{blocks[i // 6].title} {blocks[i // 6].components[i % 6]}" for i in named)
    moving = sorted({int(i) // 6 for i in named})
    sigma = min(float(abs(spread[largest]) * limits[largest]), _LARGEST_SIGMA)
    numbers = blocks[largest // 6].numbers
    if isinstance(numbers, CameraNumbers):
        sigma = min(sigma * float(numbers.scales[largest % 6]), _LARGEST_SIGMA)
        why = f"the data hardly change when {', '.join(names)} change{'' if names[1:] else 's'}"
        because = intrinsics_reason(solution, largest // 6)
        return WeakDirection(
            names, sigma, numbers.units[largest % 6], f"{why}: {because}" if because else why
        )
    unit = "rad" if largest % 6 < 3 else "m"
    axis = _world_direction(solution, spread, largest)
    why = f"the data hardly change when {_motion(solution, moving, unit, axis)}"
    cameras = [i for i in moving if _is_camera(blocks[i])]
    because = known_reason or (intrinsics_reason(solution, cameras[0]) if cameras else None)
    because = because or reason(solution, [i for i in moving if i not in cameras], axis)
    return WeakDirection(names, sigma, unit, f"{why}: {because}" if because else why)


def _motion(solution: Solution, moving: Sequence[int], unit: str, axis: np.ndarray) -> str:
    """Return who moves how, in words."""
    blocks = solution.problem.parameters.blocks
    who = sorted({blocks[i].title for i in moving})
    motion, how = ("turn", "about") if unit == "rad" else ("shift", "along")
    direction = (
        f"({', '.join(f'{v:.2f}' for v in axis.round(2) + 0.0)}) of {solution.dataset.world}"
    )
    if len(who) > 1:
        return f"{', '.join(who)} {motion} {how} {direction} together"
    if unit == "rad" and is_spin_axis(solution, moving[0], axis):
        direction = f"its spin axis, {direction}"
    return f"{who[0]} {motion}s {how} {direction}"


def _world_R_parent(solution: Solution, block: int) -> np.ndarray:
    dataset = solution.dataset
    chain = dataset.graph.chain(
        dataset.world, solution.problem.parameters.blocks[block].edge.parent
    )
    collection = next(iter(dataset.collections.values()))
    return chain_transform(chain, collection.transforms)[:3, :3]


def _world_direction(solution: Solution, spread: np.ndarray, largest: int) -> np.ndarray:
    """Return the unit direction (3,) of the strongest part in world."""
    index, first = largest // 6, 0 if largest % 6 < 3 else 3
    in_parent = spread[6 * index + first : 6 * index + first + 3]
    block = solution.problem.parameters.blocks[index]
    if block.numbers is not None:
        part = np.zeros(6)
        part[first : first + 3] = in_parent
        in_parent = block.numbers.twist(solution.x[6 * index : 6 * index + 6]) @ part
        in_parent = in_parent[first : first + 3]
        if isinstance(block.numbers, BiasNumbers):  # it stands behind the origin
            in_parent = solution.dataset.joint(block.names[0]).origin[:3, :3] @ in_parent
    direction = _world_R_parent(solution, index) @ in_parent
    direction = direction / np.linalg.norm(direction)
    return direction * np.sign(direction[np.argmax(np.abs(direction))])
