"""What a simulation knows and a calibration must find: true edges and true board poses."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Mapping, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.model.dataset import Dataset, board_edge
from atom_core.model.transforms import Edge


@dataclass(frozen=True)
class Truth:
    """The true rig.

    Attributes:
        edges: true ``parent_T_child`` (4, 4) of the calibrated edges.
        boards: true ``parent_T_pattern`` (4, 4) by (pattern, collection); may be empty.
    """

    edges: Mapping[Edge, np.ndarray]
    boards: Mapping[Tuple[str, str], np.ndarray] = field(default_factory=dict)


def with_truth(dataset: Dataset, truth: Truth) -> Dataset:
    """Return the dataset with the true edges, and the true boards where they are known.

    Raises:
        DatasetError: the truth lacks the edge of a sensor.
    """
    for sensor in dataset.sensors.values():
        if sensor.edge not in truth.edges:
            raise DatasetError(f"the truth lacks edge '{sensor.edge}' of sensor '{sensor.name}'")
    changes = {}
    for key, collection in dataset.collections.items():
        edges = {e: m for e, m in truth.edges.items() if e in collection.transforms}
        for name, pattern in dataset.patterns.items():
            if (name, key) in truth.boards:
                edges[board_edge(pattern)] = truth.boards[(name, key)]
        changes[key] = edges
    return dataset.with_transforms(changes)
