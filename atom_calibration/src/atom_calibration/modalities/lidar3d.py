"""3D LiDARs: clouds, and points of the board in them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Optional, Sequence

import numpy as np
from sensor_msgs.msg import PointCloud2

from atom_calibration.messages.clouds import cloud_message, cloud_xyz, point_cloud, structured
from atom_calibration.modalities.range_labels import (
    plane_of_label,
    range_labels,
    read_range_label,
    write_range_label,
)
from atom_calibration.modalities.seeds import PointSeeds
from atom_calibration.modalities.table import RosModality
from atom_core import opencv as cv2
from atom_core.labeling.lidar3d import as_cloud, expected_points, find_layers
from atom_core.labeling.stillness import LIDAR_NOISE
from atom_core.model.labels import RangeLabel
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import LIDAR3D

if TYPE_CHECKING:
    from atom_calibration.modalities.frames import Frame

LEAST_POINTS, LEAST_LAYERS = 60, 4
_LEAST_VALID = 100  # points of a cloud that tell how its beams are spaced
_GREEN, _RED, _GREY = (60, 220, 60), (40, 40, 255), (120, 120, 120)
_PICTURE_PX, _MARGIN = 640, 1.2


@dataclass(frozen=True)
class BeamSpacing:
    """Angles between neighbouring beams of a LiDAR [rad]."""

    elevation: float
    azimuth: float

    def shortage(self, pattern: Pattern, distance_m: float) -> str:
        """Return why a board at a distance [m] gets too few points; empty when it gets enough."""
        points, layers = expected_points(pattern.border, distance_m, self.azimuth, self.elevation)
        if points >= LEAST_POINTS and layers >= LEAST_LAYERS:
            return ""
        return (
            f"only about {points} points in {layers} layers are expected on "
            f"pattern '{pattern.name}' at {distance_m:.1f} m (beams every "
            f"{np.rad2deg(self.elevation):.2f} x {np.rad2deg(self.azimuth):.2f} deg); "
            f"show the board nearer, or use a larger one"
        )


def beam_spacing(points: np.ndarray) -> Optional[BeamSpacing]:
    """Return the spacing of the beams of a structured cloud (n,); None: it has no layers.

    Raises:
        ValueError: the cloud has too few points.
    """
    xyz = cloud_xyz(points)
    valid = np.all(np.isfinite(xyz), axis=1) & np.any(xyz != 0, axis=1)
    if np.sum(valid) < _LEAST_VALID:
        raise ValueError("too few points to tell the spacing of the beams")
    scan = find_layers(as_cloud(points))
    if not scan.has_layers or len(scan.layer_elevation) < 2:
        return None
    step = float(np.median(np.diff(np.sort(scan.layer_elevation))))
    return BeamSpacing(step, float(scan.azimuth_step))


def cloud_picture(points: np.ndarray, labels: Sequence[RangeLabel], size_px: int) -> np.ndarray:
    """Return the board's neighbourhood, seen along the board's normal (size, size, 3).

    Args:
        points: (n, 3) the cloud.
        labels: on it; the first one says where the board is. Without one the picture is black.
        size_px: of the picture.
    """
    picture = np.zeros((size_px, size_px, 3), np.uint8)
    if not labels:
        return picture
    board = points[labels[0].indices]
    centre = board.mean(axis=0)
    _, _, axes = np.linalg.svd(board - centre, full_matrices=False)
    flat = (points - centre) @ axes.T
    extent = _MARGIN * np.abs(flat[labels[0].indices, :2]).max()
    near = np.flatnonzero(np.all(np.abs(flat) <= extent, axis=1))
    radius = max(size_px // 320, 1)
    _dots(picture, flat[near], extent, _GREY, radius)
    for label in labels:
        _dots(picture, flat[label.indices], extent, _GREEN, radius)
    for label in labels:
        _dots(picture, flat[label.limit_indices], extent, _RED, radius + 1)
    return picture


def _dots(picture: np.ndarray, flat: np.ndarray, extent: float, colour: tuple, radius: int) -> None:
    pixels = (0.5 + 0.5 * flat[:, :2] / extent) * (len(picture) - 1)
    for x, y in pixels.astype(int):
        cv2.circle(picture, (int(x), int(y)), radius, colour, -1)


def _draw(frame: Frame) -> np.ndarray:
    return cloud_picture(cloud_xyz(frame.data), range_labels(frame), _PICTURE_PX)


LIDAR_3D = RosModality(
    name=LIDAR3D,
    message=PointCloud2,
    decode=point_cloud,
    encode=lambda points: cloud_message(points, is_dense=False),
    to_dataset=cloud_xyz,
    from_dataset=structured,
    no_data=lambda _: structured(np.zeros((0, 3))),
    size=len,
    read_label=read_range_label,
    write_label=write_range_label,
    sighting=lambda frame, label: plane_of_label(frame, label, LIDAR_NOISE),
    draw=_draw,
    display="cloud",
    points=lambda frame, indices: cloud_xyz(frame.data[indices]),
    seeds=PointSeeds(cloud_xyz),
    cloud=lambda points: points,
    outlook=beam_spacing,
)
