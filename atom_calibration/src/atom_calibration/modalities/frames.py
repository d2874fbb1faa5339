"""One message of one sensor, decoded and labeled: what collections are made of."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Dict, Mapping, Optional

import numpy as np

from atom_calibration.errors import MessageError
from atom_calibration.messages.headers import header_document, stamp_s
from atom_calibration.modalities.table import RosModality, ros_modality
from atom_core.labeling.base import Labeled
from atom_core.labeling.stillness import Sighting
from atom_core.model.pattern import Pattern
from atom_core.model.sensor import Sensor

_MUCH_SMALLER = 2  # times, is a compressed picture, or one of a Bayer camera


@dataclass
class Frame:
    """Data of one sensor at one time.

    Attributes:
        sensor: whose.
        stamp_s: of the data [s].
        header: of the message, as datasets have it.
        data: as the sensor's modality decodes them; None for what could not be decoded.
        labels: what the labeler found, by pattern.
        seeds: where the labels were begun from, by pattern; of what was not detected, the one that
            was set by hand.
        prepared: the data with all done that labels need beside a seed, by pattern; while the frame
            is being labeled.
        sightings: what tells whether the board moved, by pattern; only of what was detected.
        packed: the message that the data were decoded from, where it is much smaller; or None.
    """

    sensor: Sensor
    stamp_s: float
    header: Mapping[str, Any]
    data: Any
    labels: Dict[str, Labeled] = field(default_factory=dict)
    seeds: Dict[str, np.ndarray] = field(default_factory=dict)
    sightings: Dict[str, Sighting] = field(default_factory=dict)
    prepared: Dict[str, Any] = field(default_factory=dict)
    packed: Any = None

    @property
    def ros(self) -> RosModality:
        """What ROS knows of the sensor's modality."""
        return ros_modality(self.sensor.modality)

    @property
    def detections(self) -> int:
        """How many patterns were found."""
        return sum(labeled.detected for labeled in self.labels.values())

    @property
    def size(self) -> int:
        """How many points or pixels the data have."""
        return 0 if self.data is None else self.ros.size(self.data)

    @property
    def place(self) -> str:
        """What names the frame in a message."""
        return f"sensor '{self.sensor.name}', topic {self.sensor.topic}, time {self.stamp_s:.3f}"

    def set_label(self, pattern: str, labeled: Labeled) -> None:
        """Keep what a labeler found."""
        self.labels[pattern] = labeled
        self.sightings.pop(pattern, None)
        sighting = self.ros.sighting(self, labeled.label) if labeled.detected else None
        if sighting is not None:
            self.sightings[pattern] = sighting

    def set_seed(self, pattern: str, seed: Optional[np.ndarray]) -> None:
        """Keep where a label was begun from; None: nowhere."""
        self.seeds.pop(pattern, None)
        if seed is not None:
            self.seeds[pattern] = seed

    def board_pose(self, pattern: Pattern) -> Optional[np.ndarray]:
        """Return ``sensor_T_pattern`` (4, 4) by the frame's label alone; None: it does not tell."""
        labeled = self.labels[pattern.name]
        if self.ros.board_pose is None or not labeled.detected:
            return None
        return self.ros.board_pose(self.sensor, pattern, labeled.label)

    def pack(self) -> None:
        """Let go of data that the message tells, too: of those that wait few are needed again."""
        if self.packed is not None:
            self.data = None

    def unpack(self) -> None:
        """Have the data again."""
        if self.data is None and self.packed is not None:
            self.data = self.ros.decode(self.packed)

    def unlabeled(self) -> Frame:
        """Return the same data without labels."""
        return Frame(self.sensor, self.stamp_s, self.header, self.data)


def decode(sensor: Sensor, message: Any) -> Frame:
    """Return the frame of a message, without labels.

    Raises:
        MessageError: naming sensor, topic and time.
    """
    frame = undecoded(sensor, message)
    try:
        frame.data = frame.ros.decode(message)
    except MessageError as error:
        raise type(error)(f"{frame.place}: {error}", sensor.name) from None
    sent, decoded = getattr(message, "data", b""), getattr(frame.data, "nbytes", 0)
    if decoded >= _MUCH_SMALLER * len(sent) > 0:
        frame.packed = message
    return frame


def undecoded(sensor: Sensor, message: Any) -> Frame:
    """Return the frame of a message without its data."""
    return Frame(sensor, stamp_s(message), header_document(message), None)


def points_of(frame: Frame, indices: np.ndarray) -> np.ndarray:
    """Return a point (3,) [m] for each index into a range sensor's data, valid or not."""
    assert frame.ros.points is not None, f"a {frame.sensor.kind.noun} has no points"
    return frame.ros.points(frame, indices)
