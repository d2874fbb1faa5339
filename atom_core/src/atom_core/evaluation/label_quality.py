"""How good one label is by itself: corners against the board's own shape, points against a plane.

No calibration is needed, so that it can be told while labels are corrected.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from atom_core.evaluation.board_pose import board_pose
from atom_core.geometry import se3
from atom_core.geometry.plane import fit_plane
from atom_core.model.dataset import Dataset, DetectionKey, RgbLabel, range_points
from atom_core.problem.measurements import CornerMeasurement

PIXELS, METRES = "px", "m"


@dataclass(frozen=True)
class LabelQuality:
    """Figures of one label.

    Attributes:
        points: corners, or points or pixels on the board.
        border_points: of them, or beside them, on its border.
        unit: of the figures: px for corners, m for points.
        rms: root mean square of the distances to where the board would have the corners (its pose
            by these corners alone), or to the plane through the points; NaN where they determine
            neither.
        worst: the largest of these distances; NaN likewise.
        worst_item: the id of that corner, or the index of that point or pixel; -1 where unknown.
    """

    points: int
    border_points: int
    unit: str
    rms: float = np.nan
    worst: float = np.nan
    worst_item: int = -1


def label_quality(dataset: Dataset, key: DetectionKey) -> LabelQuality:
    """Return the figures of a label.

    Args:
        dataset: with the label; clouds and depth images are read.
        key: of a label that is there.

    Raises:
        DatasetError: the data cannot be read, or the label does not belong to them.
    """
    label = dataset.label(key)
    if isinstance(label, RgbLabel):
        return _of_corners(dataset, key, label)
    assert label is not None
    points, border = len(label.indices), len(label.limit_indices)
    found = range_points(dataset, key)
    try:
        centre, normal, rms_m = fit_plane(found.inside)
    except ValueError:  # too few, or on one line
        return LabelQuality(points, border, METRES)
    away_m = np.abs((found.inside - centre) @ normal)
    worst = int(np.argmax(away_m))
    item = int(found.inside_indices[worst])
    return LabelQuality(points, border, METRES, rms_m, float(away_m[worst]), item)


def _of_corners(dataset: Dataset, key: DetectionKey, label: RgbLabel) -> LabelQuality:
    camera = dataset.sensors[key.sensor].camera
    assert camera is not None
    corners = dataset.patterns[key.pattern].corners_of(label.ids)
    pose = board_pose(CornerMeasurement(key, camera, label.ids, corners, label.pixels))
    if pose is None:
        return LabelQuality(len(label.ids), 0, PIXELS)
    expected = camera.project(se3.apply(pose.camera_T_pattern, corners))
    away_px = np.linalg.norm(expected - label.pixels, axis=1)
    worst = int(np.argmax(away_px))
    return LabelQuality(
        len(label.ids), 0, PIXELS, pose.rms_px, float(away_px[worst]), int(label.ids[worst])
    )
