"""Why the data leave a direction open: what the boards and the motions have in common."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Dict, List, NamedTuple, Optional, Sequence, Set

import numpy as np

from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, pose
from atom_core.problem.blocks import (
    ADDITIONAL_TF,
    JOINT,
    PATTERN,
    SENSOR,
    ParameterBlock,
    PoseBlock,
)
from atom_core.problem.problem import Problem
from atom_core.problem.residuals import BORDER, REPROJECTION

_PARALLEL_RAD = np.deg2rad(1.0)  # RMS tilt of boards that count as parallel
_ALONG_RAD = np.deg2rad(5.0)  # and of boards that count as lying along an axis
_ONE_PLANE_M = 0.03  # RMS distance of boards that count as one plane
_STILL_RAD, _STILL_M = np.deg2rad(0.5), 0.005  # motions below this are none
_ONE_AXIS_RAD = np.deg2rad(3.0)  # RMS angle between axes that count as one
_SPIN_AXIS_RAD = np.deg2rad(15.0)
_FEW = 3
_SQUARELY_DEG = 12.0
_SAME_MOTION = 1e-9  # one minus the cosine between what two blocks can do


@dataclass(frozen=True)
class Solution:
    """A solved problem: the dataset with the solution in its transforms, and the vector."""

    dataset: Dataset
    problem: Problem
    x: np.ndarray


class Boards(NamedTuple):
    """What the boards that range sensors saw without their borders have in common.

    Attributes:
        normal: (3,) in world, of boards that are all parallel.
        words: of what they are.
    """

    normal: np.ndarray
    words: str


def reason(solution: Solution, blocks: Sequence[int], axis_in_world: np.ndarray) -> Optional[str]:
    """Return why the blocks can move along or about an axis (3,), or None where it is not seen.

    Args:
        solution: the solved problem.
        blocks: indices of the parameter blocks that move.
        axis_in_world: (3,) unit vector of the strongest motion.
    """
    return (
        _without_effect(solution.problem, blocks)
        or _joint_imitated(solution, blocks)
        or _in_series(solution.problem, blocks)
        or _boards_follow(solution.problem, blocks)
        or _along_all_boards(solution, blocks, axis_in_world)
        or _one_motion(solution, blocks, axis_in_world)
        or _few_detections(solution, blocks)
    )


def reason_in_collection(problem: Problem, block: int) -> str:
    """Return why a transform that has a value in each collection is open in that of a block."""
    because = _without_effect(problem, [block])
    if because is not None:
        return because
    if _followed(problem, [block]) is not None:
        return (
            "the boards that are seen across it may stand anywhere: they follow; let the board "
            "stand still (`fixed: true`), or leave the transform out of additional_tfs"
        )
    here = np.flatnonzero(np.any(problem.chains.block == block, axis=1))
    names = list(dict.fromkeys(problem.detections[i].sensor for i in here))
    tell = "tells" if len(names) == 1 else "tell"
    return (
        f"only {' and '.join(names)} {tell} of it there ({len(here)} detection(s)), which leaves "
        f"this open; let more sensors see the board, or leave such collections out (-csf)"
    )


# ------------------------------------------------------------------------------- chains


def _without_effect(problem: Problem, blocks: Sequence[int]) -> Optional[str]:
    """A joint or a transform that stands in no chain from a sensor to a board."""
    for i in blocks:
        block = problem.parameters.blocks[i]
        if block.kind not in (JOINT, ADDITIONAL_TF) or np.any(problem.chains.block == i):
            continue
        seen = "no sensor and no board that was seen hangs on"
        if block.kind == JOINT:
            return f"{seen} {block.title}; hold it"
        return f"{seen} '{block.title}' ({block.edge}); leave it out of additional_tfs"
    return None


def _joint_imitated(solution: Solution, blocks: Sequence[int]) -> Optional[str]:
    """A joint's parameter and another block that can do the same to every detection."""
    parameters = solution.problem.parameters
    if not any(parameters.blocks[i].kind == JOINT for i in blocks):
        return None
    _, jacobians = solution.problem.poses_and_jacobians(solution.x)
    bases = {i: _reach(solution.problem, jacobians, i) for i in blocks}
    for i in blocks:
        for j in blocks:
            if parameters.blocks[i].kind != JOINT or i == j:
                continue
            common = np.linalg.svd(bases[i].T @ bases[j], compute_uv=False)
            if np.max(common, initial=0.0) > 1.0 - _SAME_MOTION:
                one, two = (parameters.blocks[k].title for k in (i, j))
                return (
                    f"{_parameters_of(parameters.blocks[i])} of {one} does to every detection what "
                    f"{_parameters_of(parameters.blocks[j])} of {two} can do too, so that only "
                    f"both together are seen; estimate one of the two"
                )
    return None


def _parameters_of(block: ParameterBlock) -> str:
    if isinstance(block, PoseBlock):
        return "the pose"
    return " or ".join(name for _, name in block.free_components)


def _reach(problem: Problem, jacobians: np.ndarray, block: int) -> np.ndarray:
    """Return an orthonormal basis (c d, k) of what a block can do to the detections' states."""
    mine = (problem.dependencies == block)[:, :, None, None]
    moved = np.where(mine, jacobians, 0.0).sum(axis=1)
    columns = problem.parameters.by_block(moved)[:, problem.parameters.free[block]]
    columns = columns / np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    left, singular, _ = np.linalg.svd(columns, full_matrices=False)
    return left[:, singular > 1e-9]


def _in_series(problem: Problem, blocks: Sequence[int]) -> Optional[str]:
    """Two edges that always follow one another at a constant distance are one too many."""
    edges = [i for i in blocks if isinstance(problem.parameters.blocks[i], PoseBlock)]
    for i in edges:
        for j in edges:
            if i < j and _always_adjacent(problem, i, j):
                one, two = (problem.parameters.blocks[k] for k in (i, j))
                return (
                    f"the edges '{one.edge}' and '{two.edge}' follow one another on every chain "
                    f"with nothing that moves between them, so that only their product is seen; "
                    f"estimate one of the two"
                )
    return None


def _always_adjacent(problem: Problem, i: int, j: int) -> bool:
    chains = problem.chains
    between: List[np.ndarray] = []
    for row, constants in zip(chains.block, chains.constants):
        at = {int(b): k for k, b in enumerate(row) if b in (i, j)}
        if not at:
            continue
        if len(at) == 1 or abs(at[i] - at[j]) != 1:
            return False
        between.append(constants[max(at.values())])
    return bool(between) and bool(np.allclose(between, between[0], atol=1e-9))


def _boards_follow(problem: Problem, blocks: Sequence[int]) -> Optional[str]:
    """An edge above everything that sees a board moves boards and all."""
    i = _followed(problem, blocks)
    if i is None:
        return None
    return (
        f"edge '{problem.parameters.blocks[i].edge}' stands between the boards and every sensor "
        f"that sees them, and the boards' own poses are free: they follow; hold one of them"
    )


def _followed(problem: Problem, blocks: Sequence[int]) -> Optional[int]:
    """Return which of the blocks has boards that can follow it, None where none has."""
    own = {i for i, b in enumerate(problem.parameters.blocks) if b.kind == PATTERN}
    chains = problem.chains.block
    for i in blocks:
        if i in own:
            continue
        mine = np.any(chains == i, axis=1)
        boards = {int(b) for b in chains[mine].ravel() if int(b) in own}
        seen = np.any(np.isin(chains, list(boards)), axis=1)
        if np.any(mine) and np.array_equal(seen, mine) and _always_beside(problem, i, own):
            return i
    return None


def _always_beside(problem: Problem, i: int, others: Set[int]) -> bool:
    """Tell whether a block has one of others beside it in every chain, and nothing moves between.

    What stands between may differ from pattern to pattern, whose parents are others.
    """
    between: Dict[str, List[np.ndarray]] = {}
    chains = problem.chains
    for row, constants, key in zip(chains.block, chains.constants, problem.detections):
        if i not in row:
            continue
        at = int(np.flatnonzero(row == i)[0])
        near = [k for k in (at - 1, at + 1) if 0 <= k < len(row) and int(row[k]) in others]
        if not near:
            return False
        between.setdefault(key.pattern, []).append(constants[max(at, near[0])])
    return all(np.allclose(poses, poses[0], atol=1e-9) for poses in between.values())


# ------------------------------------------------------------------------------- boards


class _Planes(NamedTuple):
    """What sensors that see planes only saw: unit normals (n, 3) and centres (n, 3), in world."""

    sensors: str
    normals: np.ndarray
    centres: np.ndarray


def _planes(solution: Solution, block: int) -> Optional[_Planes]:
    """Return a sensor block's boards; None where corners or borders tell of them too."""
    problem = solution.problem
    sensors = set(problem.parameters.blocks[block].names)
    kinds = {b.kind for b in problem.residual_blocks if b.sensor in sensors}
    if problem.parameters.blocks[block].kind != SENSOR or kinds & {BORDER, REPROJECTION}:
        return None
    mine = [i for i, key in enumerate(problem.detections) if key.sensor in sensors]
    pairs = np.array([_plane_in_world(solution, i) for i in mine])
    normals = pairs[:, 0] * np.where(pairs[:, 0] @ pairs[0, 0] < 0, -1.0, 1.0)[:, None]
    return _Planes(" and ".join(sorted(sensors)), normals, pairs[:, 1])


def parallel_boards(solution: Solution, block: int) -> Optional[Boards]:
    """Tell whether a block's sensors saw planes only, and all of them parallel.

    Points on a plane tell nothing of shifts along it and turns about its normal; corners and
    borders do.
    """
    planes = _planes(solution, block)
    if planes is None:
        return None
    _, singular, axes = np.linalg.svd(planes.normals, full_matrices=False)
    if np.sqrt(np.sum(singular[1:] ** 2) / len(planes.normals)) > _PARALLEL_RAD:
        return None
    if len(planes.normals) == 1:
        words = f"{planes.sensors} saw the inside of a single board"
    else:
        one = np.std(planes.centres @ axes[0]) < _ONE_PLANE_M
        layout = "lie in one plane" if one else "are parallel"
        words = (
            f"all boards that {planes.sensors} saw {layout}, and none of their borders is labeled"
        )
    return Boards(axes[0], f"{words}; add boards held at other angles")


def _along_all_boards(
    solution: Solution, blocks: Sequence[int], axis_in_world: np.ndarray
) -> Optional[str]:
    planes = _planes(solution, blocks[0]) if len(blocks) == 1 else None
    if planes is None:
        return None
    if np.sqrt(np.mean((planes.normals @ axis_in_world) ** 2)) > _ALONG_RAD:
        return None
    return (
        f"all boards that {planes.sensors} saw lie along this axis, and none of their borders is "
        f"labeled; add boards that are tilted against it"
    )


def _plane_in_world(solution: Solution, detection: int) -> List[np.ndarray]:
    """Return a board's normal and its origin (3,), in world."""
    dataset, key = solution.dataset, solution.problem.detections[detection]
    frame = dataset.patterns[key.pattern].frame
    world_T_pattern = pose(dataset.collections[key.collection], dataset.graph, dataset.world, frame)
    return [world_T_pattern[:3, 2], world_T_pattern[:3, 3]]


def is_spin_axis(solution: Solution, block: int, axis_in_world: np.ndarray) -> bool:
    """Tell whether an axis is that about which a block's LiDAR spins."""
    dataset = solution.dataset
    if solution.problem.parameters.blocks[block].kind != SENSOR:
        return False
    for name in solution.problem.parameters.blocks[block].names:
        sensor = dataset.sensors.get(name)
        if sensor is not None and sensor.kind.spins_about_z:
            collection = next(iter(dataset.collections.values()))
            z = pose(collection, dataset.graph, dataset.world, sensor.frame)[:3, 2]
            return bool(abs(z @ axis_in_world) > np.cos(_SPIN_AXIS_RAD))
    return False


# ------------------------------------------------------------------------------ motions


def _one_motion(
    solution: Solution, blocks: Sequence[int], axis_in_world: np.ndarray
) -> Optional[str]:
    """A robot that turns about one axis, or not at all, leaves what lies along that axis."""
    for frame, poses in _moving_frames(solution, blocks).items():
        turns = se3.rotation_vector_from_rotation(poses[:, :3, :3] @ poses[0, :3, :3].T)
        angles = np.linalg.norm(turns, axis=1)
        if np.max(angles) < _STILL_RAD:
            return f"frame '{frame}' moves but never turns; collect with turns about two axes"
        _, singular, axes = np.linalg.svd(turns, full_matrices=False)
        off_axis = np.sqrt(np.sum(singular[1:] ** 2) / np.sum(singular**2))
        if off_axis < _ONE_AXIS_RAD and abs(axes[0] @ axis_in_world) > 0.9:
            return (
                f"frame '{frame}' turns about this axis only, as in planar motion, which leaves "
                f"what lies along it open; collect with a tilted robot, or hold one of them"
            )
    return None


def _moving_frames(solution: Solution, blocks: Sequence[int]) -> Dict[str, np.ndarray]:
    """Return ``world_T_frame`` (n, 4, 4) of the frames that carry the blocks, where it varies."""
    dataset, problem = solution.dataset, solution.problem
    used = dict.fromkeys(key.collection for key in problem.detections)
    moving = {}
    for i in blocks:
        frame = problem.parameters.blocks[i].edge.parent
        poses = np.array(
            [pose(dataset.collections[key], dataset.graph, dataset.world, frame) for key in used]
        )
        shifts_m, turns_rad = se3.pose_differences(poses[0], poses)
        if np.max(shifts_m) > _STILL_M or np.max(turns_rad) > _STILL_RAD:
            moving[frame] = poses
    return moving


def _few_detections(solution: Solution, blocks: Sequence[int]) -> Optional[str]:
    for i in blocks:
        names = solution.problem.parameters.blocks[i].names
        count = sum(key.sensor in names for key in solution.problem.detections)
        if 0 < count < _FEW:
            return f"{' and '.join(names)} shares only {count} detection(s) with other sensors"
    return None


def intrinsics_reason(solution: Solution, block: int) -> Optional[str]:
    """Return why a camera's intrinsics are open, or None where it is not seen."""
    problem = solution.problem
    (name,) = problem.parameters.blocks[block].names
    mine = [i for i, key in enumerate(problem.detections) if key.sensor == name]
    squarely = problem.poses(solution.x)[mine][:, 2, 2]
    cosines = np.minimum(np.abs(squarely), 1.0)
    tilts_deg = np.degrees(np.arccos(cosines))
    tilt = np.sqrt(np.mean(tilts_deg**2))
    if tilt < _SQUARELY_DEG:
        return (
            f"{name} looks squarely at all boards (tilted by {tilt:.0f} deg), so that a longer "
            f"focal length and farther boards are the same; tilt them by 30 deg and more"
        )
    if len(mine) < _FEW:
        return f"{name} saw only {len(mine)} board(s)"
    return None
