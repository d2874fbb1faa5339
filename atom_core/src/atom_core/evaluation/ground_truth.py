"""How far the sensors are from where they truly are."""

from __future__ import annotations

from typing import Dict, List

import numpy as np

from atom_core.errors import DatasetError
from atom_core.evaluation.metrics import pose_difference
from atom_core.model.dataset import Dataset, pose
from atom_core.model.truth import Truth, with_truth

MEAN = "mean"


def ground_truth_errors(dataset: Dataset, truth: Truth) -> Dict[str, Dict[str, float]]:
    """Compare the sensors' poses with the true ones.

    A sensor's pose is that of its data frame in the anchored sensor's data frame, or in that of
    the configuration's first sensor; ``world_translation_error_m`` is about its place in the
    world. Where a chain moves, errors are means over the collections.

    Args:
        dataset: with the calibrated edges.
        truth: with the true ones.

    Returns:
        By sensor ``translation_error_m``, ``rotation_error_deg`` and
        ``world_translation_error_m``; under "mean" the first two, over all sensors but the
        reference.

    Raises:
        DatasetError: the truth lacks the edge of a sensor, or the dataset has no sensor.
    """
    reference = reference_sensor(dataset)
    true = with_truth(dataset, truth)
    errors = {name: _errors(name, reference, dataset, true) for name in dataset.sensors}
    others = [value for name, value in errors.items() if name != reference] or [errors[reference]]
    mean = {
        figure: float(np.mean([value[figure] for value in others]))
        for figure in ("translation_error_m", "rotation_error_deg")
    }
    return {MEAN: mean, **errors}


def reference_sensor(dataset: Dataset) -> str:
    """Return the anchored sensor, or the first one where none is anchored or it was left out."""
    if not dataset.sensors:
        raise DatasetError(f"{dataset.source}: there is no sensor to compare with the truth")
    anchored = dataset.config.anchored_sensor
    if anchored is not None and anchored in dataset.sensors:
        return anchored
    return next(iter(dataset.sensors))


def _errors(name: str, reference: str, dataset: Dataset, true: Dataset) -> Dict[str, float]:
    frame, reference_frame = dataset.sensors[name].frame, dataset.sensors[reference].frame
    graph = dataset.graph
    rows: List[List[float]] = []
    for key, collection in dataset.collections.items():
        both = (collection, true.collections[key])
        found, wanted = (pose(c, graph, reference_frame, frame) for c in both)
        move, turn = pose_difference(wanted, found)
        in_world, true_in_world = (pose(c, graph, dataset.world, frame)[:3, 3] for c in both)
        in_the_world = float(np.linalg.norm(in_world - true_in_world))
        rows.append([move, float(np.degrees(turn)), in_the_world])
    translation, rotation, world = np.mean(rows, axis=0)
    return {
        "translation_error_m": float(translation),
        "rotation_error_deg": float(rotation),
        "world_translation_error_m": float(world),
    }
