"""Joints whose positions are off: by the same in all collections, in proportion, or in a wave.

And joints whose axes are not where the description has them.

Their numbers belong to the chain, unlike other errors of the model: they change the detections'
poses. An offset is estimated as the joint's `position_bias` (`problem/joint_blocks.py`).
"""

from __future__ import annotations

from typing import Dict, List, Mapping

import numpy as np

from atom_core.calibration.refine.told_joints import States, twists_in_sensors
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset
from atom_core.model.joints import JointState
from atom_core.model.transforms import Edge
from atom_core.problem.blocks import ROTATION, TRANSLATION
from atom_core.problem.model_errors import (
    RADIAN,
    EdgeOffset,
    JointOffset,
    JointPositionError,
    JointScale,
    JointShift,
    JointTilt,
    JointWave,
    ModelError,
    PrismaticEdgeOffset,
    PrismaticOffset,
    TurnTrend,
)
from atom_core.problem.moving_blocks import MovingPart
from atom_core.problem.problem import Problem

_STILL = 1e-6  # positions [rad, m] of a joint that does not move
# By whether the dataset has the joint's positions, and whether they are lengths.
_OFFSETS = {
    (True, False): JointOffset,
    (True, True): PrismaticOffset,
    (False, False): EdgeOffset,
    (False, True): PrismaticEdgeOffset,
}


def joint_candidates(
    dataset: Dataset, problem: Problem, told: Mapping[str, States]
) -> List[JointPositionError]:
    """Return the errors that joints may have which are not estimated.

    Args:
        dataset: with the solution in its transforms.
        problem: whose detections are to depend on them.
        told: the joints, as of `told_joints`.
    """
    found: List[JointPositionError] = []
    for name, joints in told.items():
        first = next(iter(joints.values()))
        axis = np.zeros(6)
        axis[TRANSLATION if first.is_prismatic else ROTATION] = first.axis  # the same in the child
        twists = twists_in_sensors(dataset, problem, first.edge, dict.fromkeys(joints, axis))
        if np.any(twists):
            positions = np.array([joints[key.collection].position for key in problem.detections])
            found.append(_OFFSETS[name in dataset.joints, first.is_prismatic](name, twists))
            found += _errors_of(name, first, twists, positions)
            found += _axis_errors_of(dataset, problem, name, joints)
    return found


def sizes_on_moving_parts(
    sizes: Mapping[ModelError, float], dataset: Dataset, moving: Mapping[Edge, MovingPart]
) -> Dict[ModelError, float]:
    """Return standard deviations of errors: of joints' axes and trends as far as an arm is off.

    An arm that was given room, as if it were off by chance in each collection, may be off by its
    links and axes, the same way wherever it stands alike. No check names these.

    Args:
        sizes: what is usual, in the errors' units.
        dataset: with the joints.
        moving: how far moving parts are off.
    """
    found, joints = dict(sizes), dataset.joints
    for edge, part in moving.items():
        carried = {str(step.edge) for step in dataset.graph.chain(dataset.world, edge.child)}
        for error, size in sizes.items():
            if isinstance(error, (JointTilt, JointShift, TurnTrend)):
                turns = error.unit == RADIAN
                off = part.sigma_rad if turns else part.sigma_m
                name = error.target
                if (str(joints[name].edge) if name in joints else name) in carried:
                    found[error] = max(size, found[error], off)
    return found


def _axis_errors_of(
    dataset: Dataset, problem: Problem, name: str, joints: Mapping[str, JointState]
) -> List[JointPositionError]:
    """Return turns of a joint's axis about two axes across it, and shifts along these.

    There are none where it stands still.
    """
    states = list(joints.values())
    if np.ptp([state.position for state in states]) <= _STILL:
        return []
    _, _, axes = np.linalg.svd(states[0].axis[None])
    found: List[JointPositionError] = []
    for across, axis in enumerate(axes[1:]):
        for kind, part in ((JointTilt, ROTATION), (JointShift, TRANSLATION)):
            move = np.zeros(6)
            move[part] = axis
            in_child = {
                key: se3.adjoint(se3.inverse(state.moved)) @ move for key, state in joints.items()
            }
            twists = twists_in_sensors(dataset, problem, states[0].edge, in_child)
            found.append(kind(name, twists, across))
    return found


def _errors_of(
    name: str, joint: JointState, twists: np.ndarray, positions: np.ndarray
) -> List[JointPositionError]:
    """Return what goes with a joint's position, given what each detection has of it and its motion.

    The part that is the same for all detections is the offset's, and told beside it.
    """
    found: List[JointPositionError] = []
    if np.ptp(positions) <= _STILL:
        return found

    def varying(share: np.ndarray) -> np.ndarray:
        return twists * (share - np.mean(share))[:, None]

    found.append(JointScale(name, varying(positions)))
    if not joint.is_prismatic:
        waves = (np.sin(positions), np.cos(positions))
        found += [JointWave(name, varying(share), phase) for phase, share in enumerate(waves)]
    return found
