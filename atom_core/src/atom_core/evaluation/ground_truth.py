"""How far the sensors are from where they truly are."""

from __future__ import annotations

from typing import Mapping, NamedTuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.evaluation.metrics import pose_difference
from atom_core.model.dataset import Dataset, pose
from atom_core.model.truth import Truth, with_truth


class MeanError(NamedTuple):
    """How far sensors are from where they truly are, relative to the reference, on average."""

    translation_m: float
    rotation_deg: float


class SensorError(NamedTuple):
    """How far one sensor is from where it truly is.

    Attributes:
        translation_m, rotation_deg: of its data frame in the reference's.
        world_translation_m: of its place in the world.
    """

    translation_m: float
    rotation_deg: float
    world_translation_m: float


class GroundTruth(NamedTuple):
    """A calibration's errors against the truth.

    Attributes:
        mean: over all sensors but the reference.
        sensors: by name.
    """

    mean: MeanError
    sensors: Mapping[str, SensorError]


def ground_truth_errors(dataset: Dataset, truth: Truth) -> GroundTruth:
    """Compare the sensors' poses with the true ones.

    A sensor's pose is that of its data frame in the anchored sensor's data frame, or in that of
    the configuration's first sensor. Where a chain moves, errors are means over the collections.

    Args:
        dataset: with the calibrated edges.
        truth: with the true ones.

    Raises:
        DatasetError: the truth lacks the edge of a sensor, or the dataset has no sensor.
    """
    reference = reference_sensor(dataset)
    true = with_truth(dataset, truth)
    errors = {name: _error(name, reference, dataset, true) for name in dataset.sensors}
    others = [value for name, value in errors.items() if name != reference] or [errors[reference]]
    mean = MeanError(
        float(np.mean([error.translation_m for error in others])),
        float(np.mean([error.rotation_deg for error in others])),
    )
    return GroundTruth(mean, errors)


def reference_sensor(dataset: Dataset) -> str:
    """Return the anchored sensor, or the first one where none is anchored or it was left out."""
    if not dataset.sensors:
        raise DatasetError(f"{dataset.source}: there is no sensor to compare with the truth")
    anchored = dataset.config.anchored_sensor
    if anchored is not None and anchored in dataset.sensors:
        return anchored
    return next(iter(dataset.sensors))


def _error(name: str, reference: str, dataset: Dataset, true: Dataset) -> SensorError:
    frame, reference_frame = dataset.sensors[name].frame, dataset.sensors[reference].frame
    graph = dataset.graph
    rows = []
    for key, collection in dataset.collections.items():
        both = (collection, true.collections[key])
        found, wanted = (pose(c, graph, reference_frame, frame) for c in both)
        move, turn = pose_difference(wanted, found)
        in_world, true_in_world = (pose(c, graph, dataset.world, frame)[:3, 3] for c in both)
        in_the_world = float(np.linalg.norm(in_world - true_in_world))
        rows.append([move, float(np.degrees(turn)), in_the_world])
    return SensorError(*(float(value) for value in np.mean(rows, axis=0)))
