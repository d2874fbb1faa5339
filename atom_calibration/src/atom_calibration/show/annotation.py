"""Labeled data as messages to look at: what RViz shows on TOPIC/labeled."""

from __future__ import annotations

import textwrap
from typing import Sequence, Union

import numpy as np
from sensor_msgs.msg import Image, PointCloud2

from atom_calibration.labels.label_messages import header_message
from atom_calibration.messages.clouds import cloud_message
from atom_calibration.messages.images import image_message
from atom_calibration.modalities.frames import Frame, points_of
from atom_core import opencv as cv2
from atom_core.model.labels import RangeLabel

INSIDE_RGB, BORDER_RGB = 0x3CDC3C, 0xFF2828
_WHITE, _BLACK = (255, 255, 255), (0, 0, 0)
# What is written in a picture has its size for one of this width [px]; so many letters fit then.
_WIDTH_PX, _LETTERS, _MOST_LINES = 300.0, 36, 4
# A point as RViz colours it; `idx` is its index in the sensor's own cloud.
POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<u4"), ("idx", "<u4")])


def annotated(frame: Frame) -> Union[Image, PointCloud2]:
    """Return an image with the labels drawn in, or the cloud of the labeled points alone."""
    if frame.sensor.kind.has_camera_info:
        return picture_message(frame, frame.ros.draw(frame))
    return labeled_cloud(frame)


def picture_message(frame: Frame, picture: np.ndarray) -> Image:
    """Return a picture (height, width, 3) of a frame's data, with why labels are lacking."""
    _write(picture, [x.reason for x in frame.labels.values() if not x.detected])
    message = image_message(picture, "bgr8")
    message.header = header_message(frame)
    return message


def _write(picture: np.ndarray, sentences: Sequence[str]) -> None:
    """Write sentences at the top, to be read in a pane that is far narrower than the picture."""
    scale = picture.shape[1] / _WIDTH_PX
    lines = [line for text in sentences for line in textwrap.wrap(text, _LETTERS)]
    for number, line in enumerate(lines[:_MOST_LINES], start=1):
        place = (round(6 * scale), round(15 * scale * number))
        for colour, thickness in ((_BLACK, 3.0), (_WHITE, 1.0)):
            cv2.putText(
                picture,
                line,
                place,
                cv2.FONT_HERSHEY_SIMPLEX,
                0.42 * scale,
                colour,
                max(round(thickness * scale), 1),
                cv2.LINE_AA,
            )


def labeled_cloud(frame: Frame) -> PointCloud2:
    """Return the labeled points, or pixels in space, of a range sensor, inside and border."""
    parts = []
    for labeled in frame.labels.values():
        label = labeled.label
        assert isinstance(label, RangeLabel)
        indices = np.union1d(label.indices, label.limit_indices)
        points = np.zeros(len(indices), POINT)
        points["idx"] = indices
        points["rgb"] = np.where(np.isin(indices, label.limit_indices), BORDER_RGB, INSIDE_RGB)
        parts.append(points)
    table = np.concatenate(parts) if parts else np.zeros(0, POINT)
    for axis, values in zip("xyz", points_of(frame, table["idx"]).T):
        table[axis] = values
    message = cloud_message(table, is_dense=True)
    message.header = header_message(frame)
    return message
