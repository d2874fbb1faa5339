"""Where sensors end, against where the description has them: exchanged ones, and others far off.

Data of another sensor fit as well as a sensor's own, and put it where the other one is. Only what
was known of the rig beforehand tells.
"""

from __future__ import annotations

from itertools import combinations
from typing import List, NamedTuple, Sequence, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.geometry import se3
from atom_core.model.dataset import Dataset, pose
from atom_core.model.transforms import Edge

# A first guess that was set in RViz, or measured with a tape, is nearer.
FAR_M, FAR_RAD = 0.5, np.radians(30.0)
# Exchanged sensors are so much nearer to each other's places than to their own.
_NEARER, _LEAST_OFF_M = 0.25, 0.2


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
    found = []
    for edge in dataset.sensor_edges:
        before, after = described.first_value(edge), dataset.first_value(edge)
        shift_m, turn_rad = se3.pose_difference(before, after)
        if (shift_m > FAR_M or turn_rad > FAR_RAD) and not np.array_equal(before, np.eye(4)):
            found.append(Displaced(edge, dataset.sensors_on(edge), shift_m, turn_rad))
    return found


def exchanged(described: Dataset, dataset: Dataset) -> List[str]:
    """Return a sentence for two sensors that each end where the description has the other.

    Args:
        described: the dataset as it was given.
        dataset: the answer.
    """
    keys = list(dataset.collections)
    before, after = _sensor_T_others(described, keys), _sensor_T_others(dataset, keys)
    if len(before) != len(after):
        return []
    own = _largest_difference(before, after)
    if own < _LEAST_OFF_M:
        return []
    rivals = []
    for (i, a), (j, b) in combinations(enumerate(dataset.sensors), 2):
        if dataset.sensors[a].modality == dataset.sensors[b].modality:
            order = np.arange(len(before))
            order[[i, j]] = j, i
            rivals.append((_largest_difference(before[np.ix_(order, order)], after), a, b))
    least, a, b = min(rivals, default=(np.inf, "", ""))
    if not least < _NEARER * own:
        return []
    return [
        f"sensors '{a}' and '{b}' each end where the description has the other: their topics, "
        f"frames or labels are exchanged, or their places in the description; put that right, and "
        f"calibrate again"
    ]


def _sensor_T_others(dataset: Dataset, keys: Sequence[str]) -> np.ndarray:
    """Return how the sensors stand to each other, (n, n, 4, 4) in the order of the dataset.

    In the first of the collections that has all of them; (0, 0, 4, 4) where none has.
    """
    for collection in (dataset.collections[key] for key in keys):
        try:
            world_T_sensors = np.stack(
                [
                    pose(collection, dataset.graph, dataset.world, sensor.frame)
                    for sensor in dataset.sensors.values()
                ]
            )
        except DatasetError:
            continue
        return se3.inverse(world_T_sensors)[:, None] @ world_T_sensors
    return np.zeros((0, 0, 4, 4))


def _largest_difference(some: np.ndarray, others: np.ndarray) -> float:
    """Return by how much two sensors stand otherwise to each other at most [m].

    A turn counts with the length of its arc one metre away. What moves all of them is nothing.
    """
    return float(np.max(np.maximum(*se3.pose_differences(some, others)), initial=0.0))
