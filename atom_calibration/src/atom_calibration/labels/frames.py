"""One message of one sensor, decoded and labeled: what collections are made of."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Dict, Mapping, Optional

import numpy as np

from atom_calibration.errors import MessageError
from atom_calibration.messages import conversions
from atom_core.labeling.base import Labeled
from atom_core.labeling.stillness import CornerSighting, Sighting, plane_sighting
from atom_core.model.labels import RangeLabel, RgbLabel
from atom_core.model.sensor import DEPTH, LIDAR3D, RGB, Sensor


@dataclass
class Frame:
    """Data of one sensor at one time.

    Attributes:
        sensor: whose.
        stamp_s: of the data [s].
        header: of the message, as datasets have it.
        data: rgb: (height, width, 3) uint8, blue green red; depth: (height, width) [m], NaN where
            none; lidar3d: structured points (n,) with the fields of the message.
        labels: what the labeler found, by pattern.
        seeds: where the labels were begun from, by pattern; of what was not detected, the one that
            was set by hand.
        sightings: what tells whether the board moved, by pattern; only of what was detected.
    """

    sensor: Sensor
    stamp_s: float
    header: Mapping[str, Any]
    data: np.ndarray
    labels: Dict[str, Labeled] = field(default_factory=dict)
    seeds: Dict[str, np.ndarray] = field(default_factory=dict)
    sightings: Dict[str, Sighting] = field(default_factory=dict)

    @property
    def detections(self) -> int:
        """How many patterns were found."""
        return sum(labeled.detected for labeled in self.labels.values())

    @property
    def place(self) -> str:
        """The words that name the frame in a message."""
        return f"sensor '{self.sensor.name}', topic {self.sensor.topic}, time {self.stamp_s:.3f}"

    def set_label(self, pattern: str, labeled: Labeled) -> None:
        """Keep what a labeler found."""
        self.labels[pattern] = labeled
        self.sightings.pop(pattern, None)
        sighting = sighting_of(self, labeled) if labeled.detected else None
        if sighting is not None:
            self.sightings[pattern] = sighting

    def set_seed(self, pattern: str, seed: Optional[np.ndarray]) -> None:
        """Keep where a label was begun from; None: nowhere."""
        self.seeds.pop(pattern, None)
        if seed is not None:
            self.seeds[pattern] = seed

    def unlabeled(self) -> Frame:
        """Return the same data without labels."""
        return Frame(self.sensor, self.stamp_s, self.header, self.data)


def decode(sensor: Sensor, message: Any) -> Frame:
    """Return the frame of a message, without labels.

    Raises:
        MessageError: naming sensor, topic and time.
    """
    stamp = conversions.stamp_s(message)
    try:
        data = _DECODERS[sensor.modality](message)
    except MessageError as error:
        raise MessageError(
            f"sensor '{sensor.name}', topic {sensor.topic}, time {stamp:.3f}: {error}"
        ) from None
    return Frame(sensor, stamp, conversions.header_document(message), data)


def labeled_points(frame: Frame, indices: np.ndarray) -> np.ndarray:
    """Return points (n, 3) [m] in the sensor's frame of indices into a range sensor's data."""
    points = points_of(frame, indices)
    return points[np.all(np.isfinite(points), axis=1)]


def points_of(frame: Frame, indices: np.ndarray) -> np.ndarray:
    """Return a point (3,) [m] for each index into a range sensor's data, valid or not."""
    if frame.sensor.modality == LIDAR3D:
        return conversions.cloud_xyz(frame.data[indices])
    assert frame.sensor.camera is not None
    row, column = np.divmod(indices, frame.data.shape[1])
    pixels = np.column_stack([column, row]).astype(float)
    return frame.sensor.camera.ray_points(pixels, frame.data[row, column].astype(float))


def sighting_of(frame: Frame, labeled: Labeled) -> Any:
    """Return what a label says about where the board is; None if it says nothing."""
    label = labeled.label
    if isinstance(label, RgbLabel):
        return CornerSighting(label.ids, label.pixels)
    assert isinstance(label, RangeLabel)
    step = max(len(label.indices) // 400, 1)
    points = labeled_points(frame, label.indices[::step])
    return plane_sighting(points, depth_sensor=frame.sensor.modality == DEPTH)


_DECODERS = {
    RGB: conversions.colour_image,
    DEPTH: conversions.depth_image,
    LIDAR3D: conversions.point_cloud,
}
