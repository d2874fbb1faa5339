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

    The anchored sensor, else the first that has a link, stays where it is; where it hangs below
    the edge of another one that is placed, that one does.

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
    stays = that_stays(dataset, start, list(found))
    stays_T_start = se3.inverse(found[stays])
    poses = {name: stays_T_start @ start_T_sensor for name, start_T_sensor in found.items()}
    solved, placed, told = placed_at(dataset, stays, poses)
    if stays != start:
        told.insert(0, f"{method}: {why_not(start, stays)}")
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


def that_stays(dataset: Dataset, preferred: str, names: Sequence[str]) -> str:
    """Return the sensor that stays where it is while others are placed against it.

    A sensor that hangs below the edge of another one would move with it. So it is the preferred
    one, or the uppermost of those that carry it.

    Args:
        dataset: whose sensors.
        preferred: the sensor that should stay.
        names: of those that are placed.
    """
    graph, sensors = dataset.graph, dataset.sensors
    frame = sensors[preferred].frame
    above = {
        name: len(graph.chain(sensors[name].edge.parent, frame))
        for name in names
        if sensors[name].edge != sensors[preferred].edge
        and graph.hangs_below(frame, sensors[name].edge)
    }
    return max(above, key=lambda name: above[name]) if above else preferred


def why_not(preferred: str, stays: str) -> str:
    """Return a sentence: why another sensor stays than the one that should."""
    return f"'{preferred}' hangs below the edge of '{stays}', so that '{stays}' stays where it is"


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
    solved, edges = dataset, {dataset.sensors[fixed].edge}
    placed, remarks = [fixed], []
    for name in _carriers_first(dataset, fixed, [name for name in poses if name != fixed]):
        edge = dataset.sensors[name].edge
        if edge in edges:
            remarks.append(f"'{name}' shares its edge with another sensor, and stays below it")
            continue
        try:
            value = edge_value(solved, fixed, name, poses[name])
        except DatasetError as error:
            remarks.append(str(error))
            continue
        # At once, since the values of edges below this one depend on it.
        solved = solved.with_transforms(dict.fromkeys(solved.collections, {edge: value}))
        edges.add(edge)
        placed.append(name)
    return solved, placed, remarks


def _carriers_first(dataset: Dataset, fixed: str, names: Sequence[str]) -> List[str]:
    """Return sensors in an order in which none moves one that comes before it."""
    graph, sensors = dataset.graph, dataset.sensors
    edges = {sensors[name].edge for name in names}

    def carriers(name: str) -> int:
        chain = graph.chain(sensors[fixed].frame, sensors[name].edge.parent)
        return sum(step.edge in edges for step in chain)

    return sorted(names, key=carriers)


def check_separable(dataset: Dataset, fixed: str, name: str) -> None:
    """Refuse a sensor whose edge moves the one that is to stay along with it.

    Raises:
        DatasetError: saying what to calibrate instead.
    """
    edge, other = dataset.sensors[name].edge, dataset.sensors[fixed]
    if not dataset.graph.hangs_below(other.frame, edge):
        return
    if other.edge == edge:
        raise DatasetError(
            f"{dataset.source}: '{name}' and '{fixed}' share the edge '{edge}', which moves both; "
            f"give one of them an edge of its own in the configuration"
        )
    raise DatasetError(
        f"{dataset.source}: '{fixed}' hangs below the edge of '{name}', which moves both; "
        f"calibrate '{fixed}' against '{name}', the other way round"
    )


def edge_value(dataset: Dataset, fixed: str, name: str, fixed_T_sensor: np.ndarray) -> np.ndarray:
    """Return ``parent_T_child`` (4, 4) with which a sensor is where it is to be in another one.

    Raises:
        DatasetError: the fixed one hangs below the edge, too; or the two move against each other,
            so that no one value will do.
    """
    check_separable(dataset, fixed, name)
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
    border = dataset.patterns[key.pattern].border
    return se3.apply(found, border.centre_in_pattern[None])[0]


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
