"""From labels of range sensors to points in space."""

from __future__ import annotations

from typing import Tuple

import numpy as np

from atom_core.errors import DatasetError
from atom_core.model.dataset import Dataset
from atom_core.model.labels import DetectionKey, RangeLabel, RangePoints, place
from atom_core.model.sensor import Sensor


def cloud_points(dataset: Dataset, key: DetectionKey) -> RangePoints:
    """Return the labeled points of a cloud.

    Raises:
        DatasetError: an index outside the data, or a labeled point that is not finite.
    """
    return points_of_cloud(dataset.data.read(key.collection, key.sensor), dataset, key)


def points_of_cloud(cloud: np.ndarray, dataset: Dataset, key: DetectionKey) -> RangePoints:
    """Return the labeled ones of all points (n, 3) [m] of a sensor; see `cloud_points`."""
    inside, limit = _labeled_indices(dataset, key)
    return RangePoints(_pick(cloud, inside, key), _pick(cloud, limit, key), inside, limit, 0)


def depth_points(dataset: Dataset, key: DetectionKey) -> RangePoints:
    """Return the labeled pixels of a depth image as points along their rays, undistorted.

    Pixels without a valid depth are dropped and counted.

    Raises:
        DatasetError: an index outside the image.
    """
    sensor, image = dataset.sensors[key.sensor], dataset.data.read(key.collection, key.sensor)
    inside, limit = _labeled_indices(dataset, key)
    points_inside, kept_inside = _of_pixels(image, inside, sensor, key)
    points_limit, kept_limit = _of_pixels(image, limit, sensor, key)
    dropped = len(inside) + len(limit) - len(kept_inside) - len(kept_limit)
    return RangePoints(points_inside, points_limit, kept_inside, kept_limit, dropped)


def _labeled_indices(dataset: Dataset, key: DetectionKey) -> Tuple[np.ndarray, np.ndarray]:
    label = dataset.label(key)
    assert isinstance(label, RangeLabel)
    return np.unique(label.indices), np.unique(label.limit_indices)


def _pick(cloud: np.ndarray, indices: np.ndarray, key: DetectionKey) -> np.ndarray:
    _check_indices(indices, len(cloud), key)
    points = cloud[indices]
    bad = ~np.all(np.isfinite(points), axis=1)
    if np.any(bad):
        raise DatasetError(
            f"{place(key)}: labeled point {indices[bad][0]} is not finite ({int(bad.sum())} such "
            f"points); correct the label, or leave the collection out with -csf"
        )
    return points


def _of_pixels(
    image: np.ndarray, indices: np.ndarray, sensor: Sensor, key: DetectionKey
) -> Tuple[np.ndarray, np.ndarray]:
    """Return points (n, 3) [m] of the pixels that have a depth, and the pixels' indices (n,)."""
    _check_indices(indices, image.size, key)
    row, column = np.divmod(indices, image.shape[1])
    depth = image[row, column].astype(float)
    valid = np.isfinite(depth) & (depth > 0)
    pixels = np.column_stack([column, row])[valid].astype(float)
    assert sensor.camera is not None
    return sensor.camera.ray_points(pixels, depth[valid]), indices[valid]


def _check_indices(indices: np.ndarray, size: int, key: DetectionKey) -> None:
    if len(indices) and (indices[0] < 0 or indices[-1] >= size):
        wrong = indices[0] if indices[0] < 0 else indices[-1]
        raise DatasetError(
            f"{place(key)}: label index {wrong} is outside the data ({size} points); "
            f"the data file does not belong to this label"
        )
