"""Labels to messages and back."""

from __future__ import annotations

from typing import Any, Mapping, Optional

import numpy as np
import rospy
from std_msgs.msg import Header

from atom_calibration.errors import MessageError
from atom_calibration.messages.poses import pose_message
from atom_calibration.modalities.frames import Frame
from atom_calibration.msg import PatternLabels, SensorLabels
from atom_core.labeling.base import Labeled
from atom_core.model.pattern import Pattern


def labels_message(
    frame: Frame, patterns: Mapping[str, Pattern], manual_seed: Optional[np.ndarray] = None
) -> SensorLabels:
    """Return the labels of a frame.

    Args:
        frame: labeled.
        patterns: by name.
        manual_seed: where the user lets the sensor look for the board, if anywhere.
    """
    message = SensorLabels(sensor=frame.sensor.name, modality=frame.sensor.modality)
    message.header = header_message(frame)
    message.manual_seed = _numbers(manual_seed)
    for name, labeled in frame.labels.items():
        part = _pattern_labels(name, labeled, frame)
        pose = frame.board_pose(patterns[name])
        if pose is not None:
            part.pose_known, part.pose = True, pose_message(pose)
        message.patterns.append(part)
    return message


def header_message(frame: Frame) -> Header:
    """Return the header of a frame's data; its frame is that of the configuration."""
    stamp = frame.header["stamp"]
    return Header(stamp=rospy.Time(stamp["secs"], stamp["nsecs"]), frame_id=frame.sensor.frame)


def set_labels(frame: Frame, message: Any) -> Frame:
    """Give a frame the labels of a message of the same data; return the frame.

    Raises:
        MessageError: the labels do not belong to these data.
    """
    if message.sensor != frame.sensor.name:
        raise MessageError(f"{frame.place}: these labels are of sensor '{message.sensor}'")
    for part in message.patterns:
        largest = max((*part.idxs, *part.idxs_limit_points), default=-1)
        if largest >= frame.size:
            raise MessageError(
                f"{frame.place}: the labels have index {largest}, the data only "
                f"{frame.size} entries; is another labeler running for this sensor?"
            )
        label = frame.ros.read_label(part)
        quality = dict(zip(part.quality_names, part.quality_values))
        next_seed = np.array(part.next_seed) if part.next_seed else None
        labeled = Labeled(label, reason=part.reason, quality=quality, next_seed=next_seed)
        frame.set_label(part.pattern_name, labeled)
        frame.set_seed(part.pattern_name, np.array(part.seed) if part.seed else None)
    return frame


def point_count(part: Any) -> int:
    """Return how many corners, points or pixels a PatternLabels has."""
    return len(part.corners) or len(part.idxs)


def _pattern_labels(name: str, labeled: Labeled, frame: Frame) -> PatternLabels:
    part = PatternLabels(pattern_name=name, detected=labeled.detected, reason=labeled.reason)
    frame.ros.write_label(labeled.label, part)
    part.seed, part.next_seed = _numbers(frame.seeds.get(name)), _numbers(labeled.next_seed)
    part.quality_names = list(labeled.quality)
    part.quality_values = [float(value) for value in labeled.quality.values()]
    return part


def _numbers(position: Optional[np.ndarray]) -> list:
    return [] if position is None else [float(value) for value in position]
