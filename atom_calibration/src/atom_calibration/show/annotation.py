"""Labeled data as messages to look at: what RViz shows on TOPIC/labeled."""

from __future__ import annotations

from typing import Union

import cv2
import numpy as np
from sensor_msgs.msg import Image, PointCloud2, PointField

from atom_calibration.labels.frames import Frame, points_of
from atom_calibration.labels.label_messages import header_message
from atom_calibration.show.pictures import labeled_picture
from atom_core.model.labels import RangeLabel
from atom_core.model.sensor import LIDAR3D

INSIDE_RGB, BORDER_RGB = 0x3CDC3C, 0xFF2828
_WHITE, _BLACK = (255, 255, 255), (0, 0, 0)
# A point as RViz colours it; `idx` is its index in the sensor's own cloud.
POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("rgb", "<u4"), ("idx", "<u4")])
_FLOAT32, _UINT32 = 7, 6


def annotated(frame: Frame) -> Union[Image, PointCloud2]:
    """Return an image with the labels drawn in, or the cloud of the labeled points alone."""
    if frame.sensor.modality == LIDAR3D:
        return labeled_cloud(frame)
    return picture_message(frame, labeled_picture(frame))


def picture_message(frame: Frame, picture: np.ndarray) -> Image:
    """Return a picture (height, width, 3) of a frame's data, with why labels are lacking."""
    for line, labeled in enumerate(x for x in frame.labels.values() if not x.detected):
        place = (8, 20 + 20 * line)
        for colour, width in ((_BLACK, 3), (_WHITE, 1)):
            cv2.putText(
                picture,
                labeled.reason,
                place,
                cv2.FONT_HERSHEY_SIMPLEX,
                0.45,
                colour,
                width,
                cv2.LINE_AA,
            )
    message = image_message(picture)
    message.header = header_message(frame)
    return message


def image_message(picture: np.ndarray) -> Image:
    """Return a picture (height, width, 3), blue green red; the header is left to the caller."""
    height, width = picture.shape[:2]
    return Image(
        height=height,
        width=width,
        encoding="bgr8",
        step=3 * width,
        data=np.ascontiguousarray(picture).tobytes(),
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
    message = cloud_message(table)
    message.header = header_message(frame)
    return message


def cloud_message(table: np.ndarray) -> PointCloud2:
    """Return points (n,) of the type `POINT` as a cloud; the header is left to the caller."""
    assert POINT.fields is not None
    fields = [
        PointField(name, place[1], _FLOAT32 if name in "xyz" else _UINT32, 1)
        for name, place in POINT.fields.items()
    ]
    return PointCloud2(
        height=1,
        width=len(table),
        fields=fields,
        point_step=POINT.itemsize,
        row_step=table.nbytes,
        is_dense=True,
        data=table.tobytes(),
    )
