"""Where sensors end, against where the description has them: exchanged ones, and others far off.

Data of another sensor fit as well as a sensor's own, and put it where the other one is. Only what
was known of the rig beforehand tells.
"""

from __future__ import annotations

from itertools import combinations
from typing import Dict, List, Mapping, NamedTuple, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, pose
from atom_core.model.transforms import Edge

# A first guess that was set in RViz, or measured with a tape, is nearer.
FAR_M, FAR_RAD = 0.5, np.radians(30.0)
# Exchanged sensors are so much nearer to each other's places than to their own.
_NEARER, _LEAST_OFF_M = 0.25, 0.2

Poses = Mapping[str, np.ndarray]


class Displaced(NamedTuple):
    """An edge that ends far from where the description has it.

    Attributes:
        edge: parent and child.
        sensors: that stand on it.
        translation_m, rotation_rad: between the two.
    """

    edge: Edge
    sensors: Tuple[str, ...]
    translation_m: float
    rotation_rad: float


def displaced(described: Dataset, dataset: Dataset) -> List[Displaced]:
    """Return the sensors' edges that end far from where the description has them.

    One that it has at the origin of its parent was not guessed.

    Args:
        described: the dataset as it was given.
        dataset: the answer.
    """
    sensors: Dict[Edge, List[str]] = {}
    for name, sensor in dataset.sensors.items():
        sensors.setdefault(sensor.edge, []).append(name)
    found = []
    for edge, names in sensors.items():
        before, after = described.first_value(edge), dataset.first_value(edge)
        change = se3.inverse(before) @ after
        size = float(np.linalg.norm(change[:3, 3])), float(se3.rotation_angle(change[:3, :3]))
        if (size[0] > FAR_M or size[1] > FAR_RAD) and not np.array_equal(before, np.eye(4)):
            found.append(Displaced(edge, tuple(names), *size))
    return found


def exchanged(described: Dataset, dataset: Dataset) -> List[str]:
    """Return a sentence for two sensors that each end where the description has the other.

    Args:
        described: the dataset as it was given.
        dataset: the answer.
    """
    before, after = _world_T_sensors(described), _world_T_sensors(dataset)
    own = _largest_difference(before, after)
    if own < _LEAST_OFF_M:
        return []
    rivals = []
    for a, b in combinations(after, 2):
        if dataset.sensors[a].modality == dataset.sensors[b].modality:
            swapped = {**before, a: before[b], b: before[a]}
            rivals.append((_largest_difference(swapped, after), a, b))
    least, a, b = min(rivals, default=(np.inf, "", ""))
    if not least < _NEARER * own:
        return []
    return [
        f"sensors '{a}' and '{b}' each end where the description has the other: their topics, "
        f"frames or labels are exchanged, or their places in the description; put that right, and "
        f"calibrate again"
    ]


def _world_T_sensors(dataset: Dataset) -> Dict[str, np.ndarray]:
    """Return the sensors' poses (4, 4) in the first collection that has all of them; or none."""
    for collection in dataset.collections.values():
        try:
            return {
                name: pose(collection, dataset.graph, dataset.world, sensor.frame)
                for name, sensor in dataset.sensors.items()
            }
        except DatasetError:
            continue
    return {}


def _largest_difference(some: Poses, others: Poses) -> float:
    """Return by how much two sensors stand otherwise to each other at most [m].

    A turn counts with the length of its arc one metre away. What moves all of them is nothing.
    """
    largest = 0.0
    for a, b in combinations(others, 2):
        change = se3.inverse(se3.inverse(some[a]) @ some[b]) @ se3.inverse(others[a]) @ others[b]
        turned = float(se3.rotation_angle(change[:3, :3]))
        largest = max(largest, float(np.linalg.norm(change[:3, 3])), turned)
    return largest
