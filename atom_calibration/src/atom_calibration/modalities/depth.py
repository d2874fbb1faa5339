"""Depth cameras: depth images, and pixels of the board in them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from sensor_msgs.msg import Image

from atom_calibration.messages.images import depth_image, image_message
from atom_calibration.modalities.range_labels import (
    plane_of_label,
    range_labels,
    read_range_label,
    write_range_label,
)
from atom_calibration.modalities.seeds import PixelSeeds
from atom_calibration.modalities.table import RosModality
from atom_core import opencv as cv2
from atom_core.editing.label_corrections import LabelCorrections
from atom_core.io.images import MAX_DEPTH_M
from atom_core.labeling.stillness import DEPTH_NOISE
from atom_core.model.sensor import DEPTH, Sensor

if TYPE_CHECKING:
    from atom_calibration.modalities.frames import Frame

_GREEN, _RED = (60, 220, 60), (40, 40, 255)


def _no_image(sensor: Sensor) -> np.ndarray:
    assert sensor.camera is not None
    return np.full((sensor.camera.height, sensor.camera.width), np.nan)


def _points(frame: Frame, indices: np.ndarray) -> np.ndarray:
    """Return the points (n, 3) [m] of pixels, along their undistorted rays."""
    assert frame.sensor.camera is not None
    row, column = np.divmod(indices, frame.data.shape[1])
    pixels = np.column_stack([column, row]).astype(float)
    return frame.sensor.camera.ray_points(pixels, frame.data[row, column].astype(float))


def depth_picture(depth_m: np.ndarray) -> np.ndarray:
    """Return a depth image (height, width) [m] in grey (height, width, 3): near is bright."""
    near, far = np.nanpercentile(depth_m, [1, 99]) if np.any(np.isfinite(depth_m)) else (0.0, 1.0)
    scaled = np.nan_to_num((depth_m - near) / max(far - near, 1e-6), nan=0.0)
    grey = (255 - 215 * np.clip(scaled, 0, 1)).astype(np.uint8)
    black_without = np.where(np.isfinite(depth_m), grey, 0).astype(np.uint8)
    return cv2.cvtColor(black_without, cv2.COLOR_GRAY2BGR)


def _draw(frame: Frame) -> np.ndarray:
    picture = depth_picture(frame.data)
    for label in range_labels(frame):
        for indices, colour in ((label.indices, _GREEN), (label.limit_indices, _RED)):
            row, column = np.divmod(indices, picture.shape[1])
            picture[row, column] = colour
    return picture


def _lost_in_file(frame: Frame, report: Any) -> str:
    """Return what is lost if labeled depths are farther than a file can hold."""
    depths = [frame.data.ravel()[label.indices] for label in range_labels(frame)]
    lost = any(bool(np.any(z > MAX_DEPTH_M)) for z in depths)
    return str(report.warning or "") if lost else ""


def _polygon(
    corrections: LabelCorrections, sensor: str, polygon: np.ndarray, removes_border: bool
) -> str:
    if removes_border:
        return corrections.remove_border(sensor, polygon)
    return corrections.refill(sensor, polygon)


DEPTH_CAMERA = RosModality(
    name=DEPTH,
    message=Image,
    decode=depth_image,
    encode=lambda depth_m: image_message(depth_m.astype("<f4"), "32FC1"),
    to_dataset=lambda depth_m: depth_m,
    from_dataset=lambda depth_m: depth_m,
    no_data=_no_image,
    size=lambda depth_m: int(depth_m.size),
    read_label=read_range_label,
    write_label=write_range_label,
    sighting=lambda frame, label: plane_of_label(frame, label, DEPTH_NOISE),
    draw=_draw,
    display="depth_cloud",
    points=_points,
    seeds=PixelSeeds(),
    background=depth_picture,
    lost_in_file=_lost_in_file,
    click=LabelCorrections.refill_from,
    polygon=_polygon,
    polygon_first=True,
)
