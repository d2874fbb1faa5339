"""What a simulation knows and a calibration must find: true edges, joints and board poses."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Dict, Iterable, Mapping, Optional, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.model.dataset import Dataset, board_edge
from atom_core.model.transforms import Edge

_SAME = 1e-9  # m or rad


@dataclass(frozen=True)
class Truth:
    """The true rig.

    Attributes:
        edges: true ``parent_T_child`` (4, 4) of the calibrated edges.
        boards: true ``parent_T_pattern`` (4, 4) by (pattern, collection); may be empty.
        moving: likewise of edges with a value for each collection, by (edge, collection).
        joints: true parameters [m, rad] by joint.
    """

    edges: Mapping[Edge, np.ndarray]
    boards: Mapping[Tuple[str, str], np.ndarray] = field(default_factory=dict)
    moving: Mapping[Tuple[Edge, str], np.ndarray] = field(default_factory=dict)
    joints: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def value(self, edge: Edge, collection: str) -> Optional[np.ndarray]:
        """Return the true ``parent_T_child`` (4, 4) in a collection; None where it is unknown."""
        return self.moving.get((edge, collection), self.edges.get(edge))


def with_truth(dataset: Dataset, truth: Truth) -> Dataset:
    """Return the dataset with the true edges and joints, and the true boards where known.

    Raises:
        DatasetError: the truth lacks the edge of a sensor.
    """
    for sensor in dataset.sensors.values():
        if any(truth.value(sensor.edge, key) is None for key in dataset.collections):
            raise DatasetError(f"the truth lacks edge '{sensor.edge}' of sensor '{sensor.name}'")
    dataset = dataset.with_joint_parameters(_joints_that_differ(dataset, truth))
    changes = {}
    for key, collection in dataset.collections.items():
        found = {edge: truth.value(edge, key) for edge in collection.transforms}
        edges = {edge: value for edge, value in found.items() if value is not None}
        for name, pattern in dataset.patterns.items():
            if (name, key) in truth.boards:
                edges[board_edge(pattern)] = truth.boards[(name, key)]
        changes[key] = edges
    return dataset.with_transforms(changes)


def _joints_that_differ(dataset: Dataset, truth: Truth) -> Dict[str, Mapping[str, float]]:
    """Return the true parameters of joints that have others; the others' transforms stay."""
    found = {}
    for name in dataset.joints.keys() & truth.joints.keys():
        now = dataset.joints[name].parameters
        if any(abs(now[key] - value) > _SAME for key, value in truth.joints[name].items()):
            found[name] = truth.joints[name]
    return found


def truth_of(dataset: Dataset) -> Truth:
    """Return what a dataset says of its calibrated edges, joints and boards, as the truth."""
    constant: Dict[Edge, np.ndarray] = {}
    moving: Dict[Tuple[Edge, str], np.ndarray] = {}
    for edge in dataset.calibrated_edges:
        values = {
            key: collection.transforms[edge]
            for key, collection in dataset.collections.items()
            if edge in collection.transforms
        }
        if values and _is_one(values.values()):
            constant[edge] = next(iter(values.values()))
        else:
            moving.update({(edge, key): matrix for key, matrix in values.items()})
    boards = {
        (name, key): collection.transforms[board_edge(pattern)]
        for name, pattern in dataset.patterns.items()
        for key, collection in dataset.collections.items()
        if board_edge(pattern) in collection.transforms
    }
    joints = {name: joint.parameters for name, joint in dataset.joints.items()}
    return Truth(constant, boards, moving, joints)


def _is_one(values: Iterable[np.ndarray]) -> bool:
    first, *others = values
    return all(np.array_equal(first, other) for other in others)
