"""What the sensors measured of the boards, detection by detection, ready for residuals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import List, Tuple, Union

import numpy as np

from atom_core.geometry.camera import Camera
from atom_core.geometry.rectangle import Rectangle
from atom_core.model.dataset import (
    Dataset,
    DetectionKey,
    RangePoints,
    RgbLabel,
    place,
    range_points,
)
from atom_core.model.sensor import DEPTH, RGB, Sensor, depth_sigma_m

# Standard deviations to begin with (depth: ``depth_sigma_m``); each sensor's are re-estimated
# from its residuals.
CORNER_SIGMA_PX = 0.3
LIDAR_SIGMA_M = 0.010


@dataclass(frozen=True)
class CornerMeasurement:
    """Corners of a pattern in one image.

    Attributes:
        key: whose detection.
        camera: intrinsics.
        ids: (n,) corner ids.
        corners_in_pattern: (n, 3) [m].
        pixels: (n, 2) [px].
    """

    key: DetectionKey
    camera: Camera
    ids: np.ndarray
    corners_in_pattern: np.ndarray
    pixels: np.ndarray


@dataclass(frozen=True)
class RangeMeasurement:
    """Points of a range sensor on one board, in the sensor's frame.

    Attributes:
        key: whose detection.
        modality: the sensor's.
        border: the board's edges in its plane [m].
        inside: (n, 3) points on the board [m].
        limit: (m, 3) points on its border [m].
        inside_sigma_m: (n,) expected deviation from the plane [m].
        limit_sigma_m: (m,) expected deviation from the border [m].
    """

    key: DetectionKey
    modality: str
    border: Rectangle
    inside: np.ndarray
    limit: np.ndarray
    inside_sigma_m: np.ndarray
    limit_sigma_m: np.ndarray


Measurement = Union[CornerMeasurement, RangeMeasurement]


def read_measurements(dataset: Dataset) -> Tuple[List[Measurement], List[str]]:
    """Return the measurement of every detection, and warnings; clouds and images are read here.

    Raises:
        DatasetError: a data file is absent or damaged, or a label does not fit it.
    """
    measurements: List[Measurement] = []
    warnings: List[str] = []
    for key, label in dataset.detections():
        sensor, pattern = dataset.sensors[key.sensor], dataset.patterns[key.pattern]
        if isinstance(label, RgbLabel):
            assert sensor.modality == RGB and sensor.camera is not None
            corners = pattern.corners_of(label.ids)
            measurements.append(
                CornerMeasurement(key, sensor.camera, label.ids, corners, label.pixels)
            )
            continue
        points = range_points(dataset, key)
        if points.dropped:
            warnings.append(f"{place(key)}: {points.dropped} labelled pixels have no depth")
        if len(points.inside) == 0:
            warnings.append(f"{place(key)}: left out, no labelled point has a value")
            continue
        measurements.append(_range_measurement(key, sensor, pattern.border, points))
    return measurements, warnings


def _range_measurement(
    key: DetectionKey, sensor: Sensor, border: Rectangle, points: RangePoints
) -> RangeMeasurement:
    if sensor.modality == DEPTH:
        assert sensor.camera is not None
        inside_sigma = depth_sigma_m(points.inside[:, 2])
        limit_sigma = points.limit[:, 2] / np.min(sensor.camera.focal_px)  # a pixel's footprint
    else:
        inside_sigma = np.full(len(points.inside), LIDAR_SIGMA_M)
        limit_sigma = np.full(len(points.limit), LIDAR_SIGMA_M)
    return RangeMeasurement(
        key, sensor.modality, border, points.inside, points.limit, inside_sigma, limit_sigma
    )
