"""How far the sensors are from where they truly are."""

from __future__ import annotations

from typing import Container, Mapping, NamedTuple, Optional

import numpy as np

from atom_core.calibration.prepare.connectivity import nothing_moves
from atom_core.errors import DatasetError
from atom_core.geometry.se3 import pose_difference
from atom_core.model.dataset import Dataset, pose
from atom_core.model.truth import Truth, with_truth


class MeanError(NamedTuple):
    """How far sensors are from where they truly are, relative to the reference, on average."""

    translation_m: float
    rotation_deg: float


class SensorError(NamedTuple):
    """How far one sensor is from where it truly is.

    Attributes:
        translation_m, rotation_deg: of its data frame in the reference's; of a reference that is
            itself estimated, in the parent of its edge.
        world_translation_m: of its place in the world.
    """

    translation_m: float
    rotation_deg: float
    world_translation_m: float


class GroundTruth(NamedTuple):
    """A calibration's errors against the truth.

    Attributes:
        mean: over all sensors; without the reference, unless it is itself estimated.
        sensors: by name.
    """

    mean: MeanError
    sensors: Mapping[str, SensorError]


def ground_truth_errors(
    dataset: Dataset, truth: Truth, held: Optional[Container[str]] = None
) -> GroundTruth:
    """Compare the sensors' poses with the true ones.

    A sensor's pose is that of its data frame in the anchored sensor's data frame, or in that of
    the configuration's first sensor. Where that reference is itself estimated, or is the only
    sensor, its own error is that of its data frame in the parent of its edge. Where a chain moves,
    errors are means over the collections.

    Args:
        dataset: with the calibrated edges.
        truth: with the true ones.
        held: names of the sensors that were not estimated; None: the reference was held if the
            configuration anchors it, or if nothing else ties the rig to the world.

    Raises:
        DatasetError: the truth lacks the edge of a sensor, or the dataset has no sensor.
    """
    reference = reference_sensor(dataset)
    true = with_truth(dataset, truth)
    origins = dict.fromkeys(dataset.sensors, dataset.sensors[reference].frame)
    counted = [name for name in dataset.sensors if name != reference]
    if not counted or _is_estimated(reference, dataset, held):
        origins[reference] = dataset.sensors[reference].edge.parent
        counted.append(reference)
    errors = {name: _error(name, frame, dataset, true) for name, frame in origins.items()}
    mean = MeanError(
        float(np.mean([errors[name].translation_m for name in counted])),
        float(np.mean([errors[name].rotation_deg for name in counted])),
    )
    return GroundTruth(mean, errors)


def _is_estimated(reference: str, dataset: Dataset, held: Optional[Container[str]]) -> bool:
    if held is not None:
        return reference not in held
    if reference == dataset.config.anchored_sensor:
        return False
    return not nothing_moves(dataset, dataset.sensors, dataset.patterns, list(dataset.collections))


def reference_sensor(dataset: Dataset) -> str:
    """Return the anchored sensor, or the first one where none is anchored or it was left out."""
    if not dataset.sensors:
        raise DatasetError(f"{dataset.source}: there is no sensor to compare with the truth")
    anchored = dataset.config.anchored_sensor
    if anchored is not None and anchored in dataset.sensors:
        return anchored
    return next(iter(dataset.sensors))


def _error(name: str, origin: str, dataset: Dataset, true: Dataset) -> SensorError:
    """Return the error of a sensor's data frame in another frame, and in the world."""
    frame = dataset.sensors[name].frame
    graph = dataset.graph
    rows = []
    for key, collection in dataset.collections.items():
        both = (collection, true.collections[key])
        found, wanted = (pose(c, graph, origin, frame) for c in both)
        move, turn = pose_difference(wanted, found)
        in_world, true_in_world = (pose(c, graph, dataset.world, frame)[:3, 3] for c in both)
        in_the_world = float(np.linalg.norm(in_world - true_in_world))
        rows.append([move, float(np.degrees(turn)), in_the_world])
    return SensorError(*(float(value) for value in np.mean(rows, axis=0)))
