"""Poses of one sensor in another, each by itself, and a rig that is put together from them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.evaluation.ground_truth import reference_sensor
from atom_core.evaluation.hand_eye_views import mean_pose
from atom_core.geometry import se3
from atom_core.geometry.pose_solvers import rigid_fit
from atom_core.geometry.se3 import pose_difference
from atom_core.model.dataset import Dataset, pose
from atom_core.model.labels import DetectionKey
from atom_core.model.transforms import Edge

FEWEST = 3  # collections from which a rigid motion is told by the boards' middles
SAME = 1e-6  # entries of a transform that differ by less do not
_LEVER_M = 1.0  # how far a turn is felt where poses are compared by one number
_FAR = 3.0  # times the median distance from the middle: not averaged


class Link(NamedTuple):
    """Where a method has one sensor in another.

    Attributes:
        source, target: the sensors.
        target_T_source: (4, 4).
        collections: how many it rests on.
    """

    source: str
    target: str
    target_T_source: np.ndarray
    collections: int


@dataclass(frozen=True)
class LinkedRig:
    """A method's answer.

    Attributes:
        method: its name.
        links: one for each pair of sensors that it could solve.
        unsolved: why there is none, by (source, target).
        dataset: with the sensors where the links have them; None where there is no link.
        placed: the sensors in it that the links place, the reference first.
        remarks: what the user should know.
    """

    method: str
    links: Tuple[Link, ...]
    unsolved: Mapping[Tuple[str, str], str]
    dataset: Optional[Dataset] = None
    placed: Tuple[str, ...] = ()
    remarks: Tuple[str, ...] = field(default=())


def linked_rig(
    method: str,
    dataset: Dataset,
    links: Sequence[Link],
    unsolved: Mapping[Tuple[str, str], str],
    remarks: Sequence[str] = (),
) -> LinkedRig:
    """Put a rig together from links: along those that rest on the most collections.

    The anchored sensor, else the first that has a link, stays where it is.

    Args:
        method: its name.
        dataset: whose sensors.
        links: each by itself.
        unsolved: why a pair has none.
        remarks: of the method.
    """
    if not links:
        return LinkedRig(method, (), dict(unsolved), remarks=tuple(remarks))
    linked = {name for link in links for name in link[:2]}
    start = reference_sensor(dataset.selected(sensors=linked))
    found = _along_the_best(start, links)
    solved, placed, told = placed_at(dataset, start, found)
    lost = [name for name in dataset.sensors if name in linked and name not in found]
    if lost:
        told.append(f"{method}: nothing links {', '.join(lost)} to {start}; they are not placed")
    return LinkedRig(method, tuple(links), dict(unsolved), solved, tuple(placed), (*remarks, *told))


def _along_the_best(start: str, links: Sequence[Link]) -> Dict[str, np.ndarray]:
    """Return ``start_T_sensor`` (4, 4) of all that links reach, the strongest links first."""
    found = {start: np.eye(4)}
    order = sorted(links, key=lambda link: -link.collections)
    while True:
        link = next((k for k in order if (k.source in found) != (k.target in found)), None)
        if link is None:
            return found
        if link.target in found:
            found[link.source] = found[link.target] @ link.target_T_source
        else:
            found[link.target] = found[link.source] @ se3.inverse(link.target_T_source)


def placed_at(
    dataset: Dataset, fixed: str, poses: Mapping[str, np.ndarray]
) -> Tuple[Dataset, List[str], List[str]]:
    """Return the dataset with sensors where they are in a fixed one.

    Args:
        dataset: whose sensors.
        fixed: the sensor that stays.
        poses: ``fixed_T_sensor`` (4, 4) by name, of the data frames.

    Returns:
        The dataset, the names of the sensors that it places, and why others are not placed.
    """
    edges: Dict[Edge, np.ndarray] = {}
    placed, remarks = [fixed], []
    for name, fixed_T_sensor in poses.items():
        edge = dataset.sensors[name].edge
        if name == fixed:
            continue
        if edge in edges or edge == dataset.sensors[fixed].edge:
            remarks.append(f"'{name}' shares its edge with another sensor, and stays below it")
            continue
        try:
            edges[edge] = edge_value(dataset, fixed, name, fixed_T_sensor)
        except DatasetError as error:
            remarks.append(str(error))
            continue
        placed.append(name)
    return dataset.with_transforms(dict.fromkeys(dataset.collections, edges)), placed, remarks


def edge_value(dataset: Dataset, fixed: str, name: str, fixed_T_sensor: np.ndarray) -> np.ndarray:
    """Return ``parent_T_child`` (4, 4) with which a sensor is where it is to be in another one.

    Raises:
        DatasetError: the two move against each other, so that no one value will do.
    """
    sensor, graph = dataset.sensors[name], dataset.graph
    values = []
    for collection in dataset.collections.values():
        reference = dataset.sensors[fixed].frame
        parent_T_fixed = pose(collection, graph, sensor.edge.parent, reference)
        child_T_sensor = pose(collection, graph, sensor.edge.child, sensor.frame)
        values.append(parent_T_fixed @ fixed_T_sensor @ se3.inverse(child_T_sensor))
    if np.max(np.ptp(np.array(values), axis=0)) > SAME:
        raise DatasetError(
            f"{dataset.source}: '{fixed}' moves against the parent of '{name}', so that one pose "
            f"cannot place it in all collections"
        )
    return values[0]


def move_against_each_other(dataset: Dataset, one: str, other: str) -> bool:
    """Tell whether two sensors are in different places to each other as parts of the rig move."""
    graph, frames = dataset.graph, [dataset.sensors[name].frame for name in (one, other)]
    poses = [pose(c, graph, *frames) for c in dataset.collections.values()]
    return bool(poses) and bool(np.max(np.ptp(np.array(poses), axis=0)) > SAME)


def sensors_of(dataset: Dataset, *kinds: str) -> List[str]:
    """Return the names of the sensors of some modalities, in the dataset's order."""
    return [name for name, sensor in dataset.sensors.items() if sensor.modality in kinds]


def seen_by_both(dataset: Dataset, one: str, other: str) -> List[Tuple[DetectionKey, DetectionKey]]:
    """Return the detections of the same boards by two sensors, in order of the collections."""
    found = []
    for key, collection in dataset.collections.items():
        for pattern in dataset.patterns:
            labels = [collection.labels.get((name, pattern)) for name in (one, other)]
            if all(label is not None and label.detected for label in labels):
                keys = [DetectionKey(key, name, pattern) for name in (one, other)]
                found.append((keys[0], keys[1]))
    return found


def board_middle(dataset: Dataset, key: DetectionKey) -> Optional[np.ndarray]:
    """Return the board's middle (3,) [m] by a range sensor's label; None where that tells none."""
    found = board_by_range(dataset, key)
    if found is None:
        return None
    centre = dataset.patterns[key.pattern].border.centre
    return se3.apply(found, np.array([[*centre, 0.0]]))[0]


def board_by_range(dataset: Dataset, key: DetectionKey) -> Optional[np.ndarray]:
    """Return ``sensor_T_pattern`` (4, 4) by plane and outline alone, one of those that fit alike.

    None where a label does not tell it.
    """
    if not dataset.data.has_data(key.collection, key.sensor):
        return None
    measurement, _ = dataset.sensors[key.sensor].kind.measure(dataset, key)
    candidates = measurement.candidates() if measurement is not None else []
    return candidates[0] if candidates else None


def motion_between(source: np.ndarray, target: np.ndarray) -> Optional[np.ndarray]:
    """Return ``target_T_source`` (4, 4) that carries points (n, 3) to others; None if not told.

    Args:
        source: (n, 3) [m].
        target: (n, 3) [m], the same points.
    """
    if len(source) < FEWEST:
        return None
    from_middle, to_middle = source - source.mean(axis=0), target - target.mean(axis=0)
    sizes = np.linalg.svd(to_middle.T @ from_middle, compute_uv=False)
    if sizes[1] < 1e-9 * max(sizes[0], 1e-12):
        return None
    return rigid_fit(source, target)


def usual_pose(poses: Sequence[np.ndarray]) -> np.ndarray:
    """Return the mean (4, 4) of the poses that most of the others are near to.

    The rotations' mean is the chordal one (Markley et al., "Averaging quaternions", 2007).
    """
    apart = np.array([[_apart(a, b) for b in poses] for a in poses])
    from_middle = apart[np.argmin(np.median(apart, axis=1))]
    limit = max(_FAR * float(np.median(from_middle)), 1e-9)
    return mean_pose([p for p, distance in zip(poses, from_middle) if distance <= limit])


def _apart(one: np.ndarray, other: np.ndarray) -> float:
    metres, radians = pose_difference(one, other)
    return metres + _LEVER_M * radians
