"""2D LiDARs: scans, and the cut of the board in them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Optional

import numpy as np
from sensor_msgs.msg import LaserScan as ScanMessage

from atom_calibration.messages.scans import laser_scan, scan_message
from atom_calibration.modalities.lidar3d import cloud_picture
from atom_calibration.modalities.range_labels import (
    range_labels,
    read_range_label,
    write_range_label,
)
from atom_calibration.modalities.seeds import ScanSeeds
from atom_calibration.modalities.table import RosModality
from atom_core.labeling.base import Labeled, Labeler
from atom_core.labeling.lidar2d import Lidar2dLabeler
from atom_core.labeling.line_sighting import LineSighting, line_sighting
from atom_core.model.labels import Label, RangeLabel
from atom_core.model.laser_scan import LaserScan
from atom_core.model.sensor import LIDAR2D

if TYPE_CHECKING:
    from atom_calibration.modalities.frames import Frame

_PICTURE_PX = 640


def _positions(scan: Optional[LaserScan]) -> np.ndarray:
    """Return the points (n, 3) [m] of a scan; of one that cannot be read none."""
    return np.zeros((0, 3)) if scan is None else scan.points


def _points(frame: Frame, indices: np.ndarray) -> np.ndarray:
    return _positions(frame.data)[indices]


def _sighting(frame: Frame, label: Label) -> Optional[LineSighting]:
    assert isinstance(label, RangeLabel)
    points = _points(frame, label.indices)
    return line_sighting(points[np.all(np.isfinite(points), axis=1)])


def _label_near(labeler: Labeler, scan: Any, seed: np.ndarray, reach_m: float) -> Labeled:
    assert isinstance(labeler, Lidar2dLabeler)
    return labeler.label(scan, seed, reach_m=reach_m)


def _encode(scan: Optional[LaserScan]) -> ScanMessage:
    return ScanMessage() if scan is None else scan_message(scan)


def _draw(frame: Frame) -> np.ndarray:
    """Draw the cut, and what is about it in the scan's plane."""
    return cloud_picture(_positions(frame.data), range_labels(frame), _PICTURE_PX)


LIDAR_2D = RosModality(
    name=LIDAR2D,
    message=ScanMessage,
    decode=laser_scan,
    encode=_encode,
    to_dataset=lambda scan: scan,
    from_dataset=lambda scan: scan,
    no_data=lambda _: None,
    size=lambda scan: len(scan.ranges),
    read_label=read_range_label,
    write_label=write_range_label,
    sighting=_sighting,
    draw=_draw,
    display="scan",
    points=_points,
    seeds=ScanSeeds(_positions),
    label_near=_label_near,
    cloud=_positions,
)
