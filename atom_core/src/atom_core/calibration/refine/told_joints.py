"""The joints of moving parts: those the dataset has positions of, and those its transforms tell.

Where only /tf was recorded, no position stands in the dataset, and yet each transform of an arm
tells one: an edge that in all collections turns about one axis, or shifts along one, is a joint.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Dict, List, Mapping, Optional

import numpy as np

from atom_core.calibration.prepare.moving_parts import moves
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, board_edge, pose
from atom_core.model.joints import PRISMATIC, REVOLUTE, JointState, joint_from_pose
from atom_core.model.transforms import Edge
from atom_core.problem.problem import Problem

_SAME = 1e-3  # entries of a transform and of what the position says
_EXACT = 1e-5  # m, rad by which a transform may miss what one axis explains
_FEWEST = 3  # places that tell an axis
States = Mapping[str, JointState]  # by collection


def told_joints(dataset: Dataset, problem: Problem) -> Dict[str, States]:
    """Return the joints that are not estimated, of which every detection's collection tells.

    By name; those of which only transforms tell have the name of their edge, and positions that
    begin where the first collection has them.

    Args:
        dataset: with the solution in its transforms.
        problem: whose detections.
    """
    taken = {block.edge for block in problem.parameters.blocks}
    used = {key.collection for key in problem.detections}
    found: Dict[str, States] = {}
    for name in sorted(dataset.joints):
        states = {k: c.joints[name] for k, c in dataset.collections.items() if name in c.joints}
        if next(iter(states.values())).edge in taken or not used <= set(states):
            continue
        if all(_is_told(dataset, key, states[key]) for key in used):
            found[name] = states
    known = taken | {next(iter(states.values())).edge for states in found.values()}
    known |= {board_edge(pattern) for pattern in dataset.patterns.values()}
    for edge in edges_between(dataset, problem):
        if edge not in known and moves(dataset, edge):
            of_edge = _of_transforms(dataset, edge)
            if of_edge and used <= set(of_edge):
                found[str(edge)] = of_edge
    return found


def _is_told(dataset: Dataset, collection: str, joint: JointState) -> bool:
    """Tell whether a transform is what the joint's position says."""
    transform = dataset.collections[collection].transforms.get(joint.edge)
    return transform is not None and np.allclose(transform, joint.parent_T_child, atol=_SAME)


def edges_between(dataset: Dataset, problem: Problem) -> List[Edge]:
    """Return the edges between sensors and the patterns that they see."""
    graph, edges = dataset.graph, {}
    for sensor, pattern in dict.fromkeys((key.sensor, key.pattern) for key in problem.detections):
        chain = graph.chain(dataset.sensors[sensor].frame, dataset.patterns[pattern].frame)
        edges.update(dict.fromkeys(step.edge for step in chain))
    return list(edges)


def _of_transforms(dataset: Dataset, edge: Edge) -> Optional[States]:
    """Return the joint that an edge's transforms are of; None where they are of none."""
    values = {
        key: collection.transforms[edge]
        for key, collection in dataset.collections.items()
        if edge in collection.transforms
    }
    first = next(iter(values.values()))
    moved = [se3.inverse(first) @ value for value in values.values()]
    turns = np.array([se3.rotation_vector_from_rotation(T[:3, :3]) for T in moved])
    shifts = np.array([T[:3, 3] for T in moved])
    for joint_type, along, other in ((REVOLUTE, turns, shifts), (PRISMATIC, shifts, turns)):
        axis = _axis(along)
        if axis is not None and np.max(np.abs(other)) < _EXACT:
            positions = along @ axis if joint_type == PRISMATIC else _unwrapped(along @ axis)
            at_first = joint_from_pose(edge, joint_type, axis, first, first)
            return {k: replace(at_first, position=p) for k, p in zip(values, positions)}
    return None


def _axis(vectors: np.ndarray) -> Optional[np.ndarray]:
    """Return the axis (3,) along which all vectors (n, 3) are, where enough of them differ."""
    _, _, axes = np.linalg.svd(vectors)
    along = vectors @ axes.T
    if np.max(np.abs(along[:, 1:])) > _EXACT:
        return None
    places = np.unique(np.round(along[:, 0] / _EXACT))
    return axes[0] if len(places) >= _FEWEST else None


def _unwrapped(angles: np.ndarray) -> np.ndarray:
    """Return angles (n,) [rad] of a joint that never was in the widest gap between them."""
    order = np.sort(angles)
    gaps = np.append(np.diff(order), order[0] + 2.0 * np.pi - order[-1])
    begin = order[(int(np.argmax(gaps)) + 1) % len(order)]
    unwrapped = (angles - begin) % (2.0 * np.pi)
    return unwrapped - unwrapped[0]


def twists_in_sensors(
    dataset: Dataset, problem: Problem, edge: Edge, in_child: Mapping[str, np.ndarray]
) -> np.ndarray:
    """Return (d, 6): how the detections' poses change, in their sensors, with an edge's child.

    Args:
        dataset: with the solution in its transforms.
        problem: whose detections.
        edge: which.
        in_child: by collection the child's own twist (6,).
    """
    graph = dataset.graph
    twists = np.zeros((len(problem.detections), 6))
    ways: Dict[Edge, float] = {}
    for d, key in enumerate(problem.detections):
        frame, pattern = dataset.sensors[key.sensor].frame, dataset.patterns[key.pattern].frame
        chain = graph.chain(frame, pattern)
        ways = {step.edge: -1.0 if step.inverted else 1.0 for step in chain}
        if edge in ways:
            collection = dataset.collections[key.collection]
            sensor_T_child = pose(collection, graph, frame, edge.child)
            twists[d] = ways[edge] * (se3.adjoint(sensor_T_child) @ in_child[key.collection])
    return twists
