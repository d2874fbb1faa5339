"""RGB cameras: images, and corners in them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Optional

import numpy as np
from sensor_msgs.msg import Image

from atom_calibration.messages.images import colour_image, image_message
from atom_calibration.modalities.table import RosModality
from atom_calibration.msg import Detection2D
from atom_core import opencv as cv2
from atom_core.editing.label_corrections import LabelCorrections
from atom_core.labeling.stillness import CornerSighting
from atom_core.model.labels import DetectionKey, Label, RgbLabel
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import RGB, Sensor
from atom_core.problem.corner_measurement import CornerMeasurement

if TYPE_CHECKING:
    from atom_calibration.modalities.frames import Frame

_GREEN, _RED = (60, 220, 60), (40, 40, 255)


def _no_image(sensor: Sensor) -> np.ndarray:
    assert sensor.camera is not None
    return np.zeros((sensor.camera.height, sensor.camera.width, 3), np.uint8)


def _read_corners(part: Any) -> Label:
    pixels = np.array([[c.x, c.y] for c in part.corners]).reshape(-1, 2)
    return RgbLabel(np.array([c.id for c in part.corners], dtype=int), pixels)


def _write_corners(label: Label, part: Any) -> None:
    assert isinstance(label, RgbLabel)
    part.corners = [
        Detection2D(int(i), float(x), float(y)) for i, (x, y) in zip(label.ids, label.pixels)
    ]


def _sighting(_: Frame, label: Label) -> CornerSighting:
    assert isinstance(label, RgbLabel)
    return CornerSighting(label.ids, label.pixels)


def _board_pose(sensor: Sensor, pattern: Pattern, label: Label) -> Optional[np.ndarray]:
    assert isinstance(label, RgbLabel) and sensor.camera is not None
    key = DetectionKey("", sensor.name, pattern.name)
    corners = pattern.corners_of(label.ids)
    poses = CornerMeasurement(key, sensor.camera, label.ids, corners, label.pixels).candidates()
    return poses[0] if poses else None


def _draw(frame: Frame) -> np.ndarray:
    picture = frame.data.copy()
    for labeled in frame.labels.values():
        label = labeled.label
        assert isinstance(label, RgbLabel)
        for number, (x, y) in zip(label.ids, label.pixels):
            centre = (int(round(16 * x)), int(round(16 * y)))
            cv2.circle(picture, centre, 5 * 16, _GREEN, 1, cv2.LINE_AA, 4)
            place = (int(x) + 6, int(y) - 4)
            cv2.putText(picture, str(number), place, cv2.FONT_HERSHEY_PLAIN, 0.7, _RED, 1)
    return picture


def _grey(image: np.ndarray) -> np.ndarray:
    """Return an image without colours: those are the labels'."""
    return cv2.cvtColor(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), cv2.COLOR_GRAY2BGR)


def _remove_corners(
    corrections: LabelCorrections, sensor: str, polygon: np.ndarray, _removes_border: bool
) -> str:
    return corrections.remove_corners(sensor, polygon)


RGB_CAMERA = RosModality(
    name=RGB,
    message=Image,
    decode=colour_image,
    encode=lambda image: image_message(image, "bgr8"),
    to_dataset=lambda image: image,
    from_dataset=lambda image: image,
    no_data=_no_image,
    size=lambda image: int(image.size),
    read_label=_read_corners,
    write_label=_write_corners,
    sighting=_sighting,
    draw=_draw,
    display="image",
    board_pose=_board_pose,
    background=_grey,
    click=LabelCorrections.click,
    polygon=_remove_corners,
)
