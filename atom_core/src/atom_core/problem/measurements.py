"""What the sensors measured of the boards, detection by detection, ready for residuals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import List, Sequence, Tuple, Union

import numpy as np
from scipy.spatial import cKDTree

from atom_core.geometry.camera import Camera
from atom_core.geometry.plane import fit_plane
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
_GRAZING = 0.05  # cosine of the incidence below which a plane is hit nowhere in particular


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
        limit_steps: (m, 2, 3) in the board's plane, from a limit point to where the next sample
            in each direction of sampling would be [m]; zero where there is no second one.
        inside_indices, limit_indices: (n,), (m,) which points of the cloud or pixels they are.
    """

    key: DetectionKey
    modality: str
    border: Rectangle
    inside: np.ndarray
    limit: np.ndarray
    inside_sigma_m: np.ndarray
    limit_sigma_m: np.ndarray
    limit_steps: np.ndarray
    inside_indices: np.ndarray
    limit_indices: np.ndarray


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
            warnings.append(f"{place(key)}: {points.dropped} labeled pixels have no depth")
        if len(points.inside) == 0:
            warnings.append(f"{place(key)}: left out, no labeled point has a value")
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
        steps = _pixel_steps(points, sensor.camera)
    else:
        inside_sigma = np.full(len(points.inside), LIDAR_SIGMA_M)
        limit_sigma = np.full(len(points.limit), LIDAR_SIGMA_M)
        steps = _beam_steps(points)
    return RangeMeasurement(
        key,
        sensor.modality,
        border,
        points.inside,
        points.limit,
        inside_sigma,
        limit_sigma,
        steps,
        points.inside_indices,
        points.limit_indices,
    )


def _pixel_steps(points: RangePoints, camera: Camera) -> np.ndarray:
    """Return (m, 2, 3): from each limit pixel to its neighbours in x and y, on the board [m]."""
    rays = points.limit / points.limit[:, 2:]
    moved = [rays + np.eye(3)[axis] / camera.focal_px[axis] for axis in (0, 1)]
    return _steps_on_plane(points, rays, moved)


def _beam_steps(points: RangePoints) -> np.ndarray:
    """Return (m, 2, 3): from each limit point to the next beam of its layer, on the board [m].

    Layers are farther apart than the beams of one, so the next beam is the nearest direction.
    Where beams were lost the step is that of the whole detection.
    """
    steps = np.zeros((len(points.limit), 2, 3))
    if len(points.inside) < 3 or len(points.limit) == 0:
        return steps
    rays, others = _unit(points.limit), _unit(points.inside)
    gap, nearest = cKDTree(others).query(rays, k=2)
    own = gap[:, 0] < 1e-7  # the limit points are among the points inside
    neighbour = others[np.where(own, nearest[:, 1], nearest[:, 0])]
    across = neighbour - rays
    length = np.linalg.norm(across, axis=1, keepdims=True)
    direction = across / np.maximum(length, 1e-12)
    moved = rays + np.median(length) * direction
    return _steps_on_plane(points, rays, [moved, rays])


def _steps_on_plane(
    points: RangePoints, rays: np.ndarray, moved: Sequence[np.ndarray]
) -> np.ndarray:
    """Return (m, 2, 3): between where rays (m, 3) and moved rays meet the board's plane [m]."""
    try:
        centroid, normal, _ = fit_plane(points.inside)
    except ValueError:
        return np.zeros((len(rays), 2, 3))

    def hit(directions: np.ndarray) -> np.ndarray:
        slope = directions @ normal
        safe = np.where(np.abs(slope) < _GRAZING, _GRAZING, slope)
        return directions * (normal @ centroid / safe)[:, None]

    return np.stack([hit(m) - hit(rays) for m in moved], axis=1)


def _unit(vectors: np.ndarray) -> np.ndarray:
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
