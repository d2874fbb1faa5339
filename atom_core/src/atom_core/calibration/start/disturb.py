"""A noisy start: free edges moved by a known amount, to study convergence."""

from __future__ import annotations

from typing import Dict

import numpy as np

from atom_core.geometry import se3
from atom_core.model.dataset import MULTIPLE, Dataset
from atom_core.model.transforms import Edge
from atom_core.problem.builder import FreeEdges


def disturbed(
    dataset: Dataset,
    free: FreeEdges,
    translation_m: float,
    rotation_rad: float,
    rng: np.random.Generator,
) -> Dataset:
    """Return the dataset with each free edge moved by exactly the given amounts.

    The translation has an isotropic random direction, the rotation an isotropic random axis. An
    edge that sensors share moves once; an anchored one not at all; an additional tf of type
    ``multiple`` moves by itself in each collection, as it is estimated. Boards are not touched:
    they must be derived again from the disturbed sensors, or they would carry the truth over.
    """
    held = free.held_edges(dataset)
    of_sensors = dataset.sensor_edges
    edges = [*of_sensors, *free.additional_tfs.values()]
    changes: Dict[str, Dict[Edge, np.ndarray]] = {key: {} for key in dataset.collections}
    for edge in dict.fromkeys(e for e in edges if e not in held):
        move = se3.random_move(translation_m, rotation_rad, rng)
        for key, collection in dataset.collections.items():
            if edge not in collection.transforms:
                continue
            if dataset.edge_types.get(edge) == MULTIPLE and edge not in of_sensors:
                move = se3.random_move(translation_m, rotation_rad, rng)
            changes[key][edge] = se3.moved(collection.transforms[edge], move)
    return dataset.with_transforms(changes)
