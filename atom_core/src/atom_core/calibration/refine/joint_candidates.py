"""Joints whose positions are off: by the same in all collections, in proportion, or in a wave.

Their numbers belong to the chain, unlike other errors of the model: they change the detections'
poses. An offset is estimated as the joint's `position_bias` (`problem/joint_blocks.py`).
"""

from __future__ import annotations

from typing import Dict, List

import numpy as np

from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, pose
from atom_core.model.joints import JointState
from atom_core.model.transforms import Edge
from atom_core.problem.blocks import ROTATION, TRANSLATION
from atom_core.problem.model_errors import (
    JointOffset,
    JointPositionError,
    JointScale,
    JointWave,
    PrismaticOffset,
)
from atom_core.problem.problem import Problem

_STILL = 1e-6  # positions [rad, m] of a joint that does not move
_SAME = 1e-3  # entries of a transform and of what the position says


def joint_candidates(dataset: Dataset, problem: Problem) -> List[JointPositionError]:
    """Return the errors that joints may have which are not estimated.

    Args:
        dataset: with the solution in its transforms.
        problem: whose detections are to depend on them.
    """
    taken = {block.edge for block in problem.parameters.blocks}
    found: List[JointPositionError] = []
    for name in sorted({name for c in dataset.collections.values() for name in c.joints}):
        joints = {k: c.joints[name] for k, c in dataset.collections.items() if name in c.joints}
        first = next(iter(joints.values()))
        used = {key.collection for key in problem.detections}
        if first.edge in taken or not used <= set(joints):
            continue
        if not all(_is_told(dataset, key, joints[key]) for key in used):
            continue
        twists = _twists(dataset, problem, first)
        if np.any(twists):
            positions = np.array([joints[key.collection].position for key in problem.detections])
            found += _errors_of(name, first, twists, positions)
    return found


def _errors_of(
    name: str, joint: JointState, twists: np.ndarray, positions: np.ndarray
) -> List[JointPositionError]:
    """Return the errors of one joint, given what each detection has of its motion and position.

    The part that is the same for all detections is the offset's: what goes with the position is
    told beside it.
    """
    offset = PrismaticOffset if joint.is_prismatic else JointOffset
    found: List[JointPositionError] = [offset(name, twists)]
    if np.ptp(positions) <= _STILL:
        return found

    def varying(share: np.ndarray) -> np.ndarray:
        return twists * (share - np.mean(share))[:, None]

    found.append(JointScale(name, varying(positions)))
    if not joint.is_prismatic:
        waves = (np.sin(positions), np.cos(positions))
        found += [JointWave(name, varying(share), phase) for phase, share in enumerate(waves)]
    return found


def _is_told(dataset: Dataset, collection: str, joint: JointState) -> bool:
    """Tell whether a transform is what the joint's position says."""
    transform = dataset.collections[collection].transforms.get(joint.edge)
    return transform is not None and np.allclose(transform, joint.parent_T_child, atol=_SAME)


def _twists(dataset: Dataset, problem: Problem, joint: JointState) -> np.ndarray:
    """Return (d, 6): how the detections' poses change, in their sensors, with the joint."""
    graph, axis = dataset.graph, np.zeros(6)
    axis[TRANSLATION if joint.is_prismatic else ROTATION] = joint.axis  # the same in the child
    twists = np.zeros((len(problem.detections), 6))
    ways: Dict[Edge, float] = {}
    for d, key in enumerate(problem.detections):
        frame, pattern = dataset.sensors[key.sensor].frame, dataset.patterns[key.pattern].frame
        chain = graph.chain(frame, pattern)
        ways = {step.edge: -1.0 if step.inverted else 1.0 for step in chain}
        if joint.edge in ways:
            collection = dataset.collections[key.collection]
            sensor_T_child = pose(collection, graph, frame, joint.edge.child)
            twists[d] = ways[joint.edge] * (se3.adjoint(sensor_T_child) @ axis)
    return twists
