"""Whether the description that the answer is written into agrees with the data."""

from __future__ import annotations

from pathlib import Path
from typing import Dict, List, Set, Tuple

import numpy as np

from atom_core.geometry import se3
from atom_core.model.believed_edges import poses_apart, sensors_by_edge
from atom_core.model.caveats import Caveat
from atom_core.model.dataset import MULTIPLE, Dataset
from atom_core.model.joints import MOVING_TYPES
from atom_core.model.robot import FIXED, RobotDescription
from atom_core.model.transforms import Edge, FrameGraph, chain_transform
from atom_core.problem.builder import FreeEdges


def description_caveats(
    dataset: Dataset, free: FreeEdges, robot: RobotDescription, path: Path
) -> List[Caveat]:
    """Return which sensors a calibrated description would put elsewhere than the dataset has them.

    It is written with the edges of sensors and with what is estimated; all others, and the other
    joints, stay as they are in it.

    Args:
        dataset: to be calibrated.
        free: what is estimated.
        robot: what the answer is to be written into.
        path: its file.
    """
    written = _written(dataset, free)
    ways = sensors_by_edge(dataset, with_boards=True)
    believed = {edge: sensors for edge, sensors in ways.items() if edge not in written}
    fixed = _fixed(dataset, believed, robot, written)
    pairs = {**fixed, **_moving(dataset, believed, robot)}
    return [
        Caveat(
            apart.sensors,
            f"the description ({path}) has '{apart.edge}' {apart.words} from where the transforms "
            f"of the data have it, and a calibrated one is as far off",
            "where an earlier calibration moved it, give --description the optimized.urdf.xacro of "
            "that one; else correct the description, or what published the transforms and collect "
            "again",
        )
        for apart in poses_apart(pairs, believed)
    ]


def _written(dataset: Dataset, free: FreeEdges) -> Set[Edge]:
    return {
        *dataset.sensor_edges,
        *free.additional_tfs.values(),
        *(joint.edge for name, joint in dataset.joints.items() if name in free.joints),
    }


def _fixed(
    dataset: Dataset, edges: Dict[Edge, List[str]], robot: RobotDescription, written: Set[Edge]
) -> Dict[Edge, Tuple[np.ndarray, np.ndarray]]:
    """Return what description and data say of edges that never move.

    An edge of the data may be several joints of the description, one behind the other.
    """
    types = {joint.edge: joint.type for joint in robot.joints.values()}
    graph, transforms, links = FrameGraph(types), robot.transforms(), set(robot.links)
    pairs: Dict[Edge, Tuple[np.ndarray, np.ndarray]] = {}
    for edge in edges:
        if dataset.edge_types.get(edge) == MULTIPLE or not {edge.parent, edge.child} <= links:
            continue
        chain = graph.chain(edge.parent, edge.child)
        if all(types[step.edge] == FIXED and step.edge not in written for step in chain):
            pairs[edge] = chain_transform(chain, transforms), dataset.first_value(edge)
    return pairs


def _moving(
    dataset: Dataset, edges: Dict[Edge, List[str]], robot: RobotDescription
) -> Dict[Edge, Tuple[np.ndarray, np.ndarray]]:
    """Return what description and data say of joints, in the middle one of the collections.

    There a position that came late while the robot moved is not taken for a difference.
    """
    joints = {joint.edge: joint for joint in robot.joints.values() if joint.type in MOVING_TYPES}
    pairs: Dict[Edge, List[Tuple[np.ndarray, np.ndarray]]] = {}
    for collection in dataset.collections.values():
        for state in collection.joints.values():
            edge = state.edge
            if edge in edges and edge in joints and edge in collection.transforms:
                described = joints[edge].parent_T_child(state.position)
                pairs.setdefault(edge, []).append((described, collection.transforms[edge]))
    return {
        edge: sorted(of_edge, key=lambda pair: se3.pose_difference(*pair))[len(of_edge) // 2]
        for edge, of_edge in pairs.items()
    }
