"""How good one label is by itself: corners against the board's own shape, points against a plane.

No calibration is needed, so that it can be told while labels are corrected.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from atom_core.evaluation.board_pose import board_pose
from atom_core.geometry import se3
from atom_core.geometry.plane import fit_plane
from atom_core.model.dataset import Dataset, range_points
from atom_core.model.labels import DetectionKey, Label, RangePoints, RgbLabel
from atom_core.problem.corner_measurement import CornerMeasurement

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
    return dataset.sensors[key.sensor].kind.quality(dataset, key)


def quality_of_points(dataset: Dataset, key: DetectionKey) -> LabelQuality:
    """Return the figures of a label of points: their distances to the plane through them."""
    label, found = dataset.label(key), range_points(dataset, key)
    assert label is not None
    try:
        centre, normal, _ = fit_plane(found.inside)
    except ValueError:  # too few, or on one line
        return LabelQuality(label.size, label.limit_size, METRES)
    return quality_of_distances(label, found, np.abs((found.inside - centre) @ normal))


def quality_of_distances(label: Label, found: RangePoints, away_m: np.ndarray) -> LabelQuality:
    """Return the figures of a label whose points (n,) are so far from their plane or line [m]."""
    worst = int(np.argmax(away_m))
    return LabelQuality(
        label.size,
        label.limit_size,
        METRES,
        float(np.sqrt(np.mean(away_m**2))),
        float(away_m[worst]),
        int(found.inside_indices[worst]),
    )


def quality_of_corners(dataset: Dataset, key: DetectionKey) -> LabelQuality:
    """Return the figures of a label of corners: how far they are from one pose of the board."""
    camera, label = dataset.sensors[key.sensor].camera, dataset.label(key)
    assert camera is not None and isinstance(label, RgbLabel)
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
