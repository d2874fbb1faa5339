"""Where boards stood before each sensor, and the clouds that range sensors measured."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Dict, List, Optional, Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.geometry import se3
from atom_core.labeling.guidance import (
    Guidance,
    all_round_box,
    board_view,
    guidance,
    image_box,
    normal_figures,
)
from atom_core.model.dataset import Dataset, board_edge, pose
from atom_core.model.labels import DetectionKey, Label, RangeLabel, RgbLabel
from atom_core.model.sensor import Sensor
from atom_core.report.residual_samples import ResidualSample, of_sensor


@dataclass(frozen=True)
class Sighting:
    """A board as a sensor saw it, at the poses of the calibration.

    Attributes:
        key: of the detection.
        label: what was found.
        sensor_T_pattern: (4, 4).
        distance_m: to the board's middle.
        tilt_deg: between its normal and the line of sight.
    """

    key: DetectionKey
    label: Label
    sensor_T_pattern: np.ndarray
    distance_m: float
    tilt_deg: float


def sightings(dataset: Dataset) -> Dict[str, List[Sighting]]:
    """Return what each sensor saw, by its name; boards whose pose nobody knows are left out."""
    graph = dataset.graph
    found: Dict[str, List[Sighting]] = {name: [] for name in dataset.sensors}
    for key, label in dataset.detections():
        pattern, collection = dataset.patterns[key.pattern], dataset.collections[key.collection]
        if board_edge(pattern) not in collection.transforms:
            continue
        frame = dataset.sensors[key.sensor].frame
        try:
            sensor_T_pattern = pose(collection, graph, frame, pattern.frame)
        except DatasetError:  # a frame that no transform of this collection has
            continue
        middle = se3.apply(sensor_T_pattern, pattern.border.centre_in_pattern[None])[0]
        distance = float(np.linalg.norm(middle))
        cosine = abs(float(middle @ sensor_T_pattern[:3, 2])) / max(distance, 1e-9)
        tilt = float(np.degrees(np.arccos(min(cosine, 1.0))))
        found[key.sensor].append(Sighting(key, label, sensor_T_pattern, distance, tilt))
    return found


def guidance_of(
    sensor: Sensor, seen: List[Sighting], samples: Tuple[ResidualSample, ...]
) -> Optional[Guidance]:
    """Return what a sensor's boards lack; None where nobody knows where in its view they were."""
    views = []
    for sighting in seen:
        box = _box(sensor, sighting, samples)
        figures = {**box, "distance_m": sighting.distance_m, "tilt_deg": sighting.tilt_deg}
        view = board_view({**figures, **normal_figures(sighting.sensor_T_pattern[:3, 2])})
        if view is not None:
            views.append(view)
    return guidance(views, sensor.camera is not None) if views or not seen else None


def _box(
    sensor: Sensor, sighting: Sighting, samples: Tuple[ResidualSample, ...]
) -> Dict[str, float]:
    pixels = label_pixels(sensor, sighting.label)
    if pixels is not None and sensor.camera is not None:
        return image_box(pixels, sensor.camera.width, sensor.camera.height)
    points = [
        sample.seen[sample.collection == sighting.key.collection]
        for sample in of_sensor(samples, sensor.name)
        if sample.seen.shape[1] == 3
    ]
    return all_round_box(np.concatenate(points)) if points and sum(map(len, points)) else {}


def label_pixels(sensor: Sensor, label: Label) -> Optional[np.ndarray]:
    """Return where a label lies in the image (n, 2) [px]; None where there is no image."""
    if isinstance(label, RgbLabel):
        return label.pixels
    if isinstance(label, RangeLabel) and sensor.camera is not None:
        return _pixels_of(label.indices, sensor.camera.width)
    return None


def limit_pixels(sensor: Sensor, label: Label) -> Optional[np.ndarray]:
    """Return where a label's border points lie in the image (n, 2) [px], as `label_pixels`."""
    if isinstance(label, RangeLabel) and sensor.camera is not None:
        return _pixels_of(label.limit_indices, sensor.camera.width)
    return None


def _pixels_of(indices: np.ndarray, width: int) -> np.ndarray:
    return np.column_stack([indices % width, indices // width]).astype(float)


def cloud(sensor: Sensor, data: Any, most: int) -> np.ndarray:
    """Return points (n, 3) that a range sensor measured, in its frame [m].

    Args:
        sensor: which; of a camera without depth nothing comes back.
        data: as its modality has them.
        most: how many points; of more a fixed random choice is taken.
    """
    if sensor.kind.measured is None:
        return np.zeros((0, 3))
    valid = np.flatnonzero(sensor.kind.measured(data))
    if len(valid) > most:
        valid = np.sort(np.random.default_rng(0).choice(valid, most, replace=False))
    if sensor.camera is not None:
        pixels = _pixels_of(valid, sensor.camera.width)
        return sensor.camera.ray_points(pixels, np.ravel(data)[valid].astype(float))
    points = data.points if hasattr(data, "points") else data
    return np.asarray(points, dtype=float)[valid]


def world_T_frame(dataset: Dataset, collection: str, frame: str) -> Optional[np.ndarray]:
    """Return (4, 4) in a collection; None where its transforms do not lead there."""
    try:
        return pose(dataset.collections[collection], dataset.graph, dataset.world, frame)
    except DatasetError:
        return None
