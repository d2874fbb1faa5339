"""How moving parts of which no joint is told may be off: in proportion to where they are.

An arm of which only the flange is told, or odometry, is off by scales, links that are too long, or
a base that tilts under its weight: errors that go with its place, the same way wherever it stands
alike. What is linear in its six coordinates stands for these.
"""

from __future__ import annotations

from typing import List, Mapping

import numpy as np

from atom_core.calibration.prepare.moving_parts import moves
from atom_core.calibration.refine.told_joints import States, edges_between, twists_in_sensors
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, board_edge
from atom_core.model.transforms import Edge
from atom_core.problem.blocks import ROTATION, TRANSLATION
from atom_core.problem.model_errors import JointPositionError, ShiftTrend, TurnTrend
from atom_core.problem.moving_blocks import MovingBlock
from atom_core.problem.problem import Problem

_STILL = 1e-4  # m, rad by which a coordinate hardly changes
_REACH_M = 3.0  # of an arm: what is farther from its parent's origin is not scaled from there


def moving_trends(
    dataset: Dataset, problem: Problem, told: Mapping[str, States], of_all: bool
) -> List[JointPositionError]:
    """Return what moving parts may be off in proportion to their coordinates.

    Each number is the standard deviation [m, rad], over the detections, of what a part is off along
    or about one axis of its parent as one of its coordinates changes.

    Args:
        dataset: with the solution in its transforms.
        problem: whose detections.
        told: the joints, as of `told_joints`.
        of_all: also of parts that have no room.
    """
    blocks = problem.parameters.blocks
    known = {block.edge for block in blocks if not isinstance(block, MovingBlock)}
    known |= {board_edge(pattern) for pattern in dataset.patterns.values()}
    known |= {joint.edge for joint in dataset.joints.values()}
    known |= {next(iter(states.values())).edge for states in told.values()}
    found: List[JointPositionError] = []
    roomy = {block.edge for block in blocks if isinstance(block, MovingBlock)}
    for edge in edges_between(dataset, problem):
        if edge not in known and (of_all or edge in roomy) and moves(dataset, edge):
            found += _of_edge(dataset, problem, edge)
    return found


def _of_edge(dataset: Dataset, problem: Problem, edge: Edge) -> List[JointPositionError]:
    poses = {
        key: collection.transforms[edge]
        for key, collection in dataset.collections.items()
        if edge in collection.transforms
    }
    turn = np.zeros((len(problem.detections), 3, 6))  # of the part about the axes of its parent
    shift = turn.copy()
    for axis in range(3):
        for twists, part in ((turn, ROTATION), (shift, TRANSLATION)):
            own = {key: np.zeros(6) for key in poses}
            for key, parent_T_child in poses.items():
                own[key][part] = parent_T_child[axis, :3]
            twists[:, axis] = twists_in_sensors(dataset, problem, edge, own)
    first = next(iter(poses.values()))
    moved = np.array([_coordinates(first, poses[k.collection]) for k in problem.detections])
    found: List[JointPositionError] = []
    for number, coordinate in enumerate(moved.T):
        size, middle = float(np.std(coordinate)), float(np.mean(coordinate))
        coordinate = coordinate if abs(middle) < _REACH_M else coordinate - middle
        if size < _STILL:
            continue
        share = (coordinate / size)[:, None]
        for axis in range(3):
            # What is mounted elsewhere than is told shifts as the part turns, and turns across it.
            if number >= 3:
                found.append(ShiftTrend(str(edge), share * shift[:, axis], number, axis))
            if number >= 3 or number == axis:
                found.append(TurnTrend(str(edge), share * turn[:, axis], number, axis))
    return found


def _coordinates(first: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Return (6,): by what a pose (4, 4) is turned from a first one, and where it is."""
    turned = se3.rotation_vector_from_rotation(pose[:3, :3] @ first[:3, :3].T)
    return np.append(turned, pose[:3, 3])
