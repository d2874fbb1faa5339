"""Which sensors will have too few points on the board, said before it is too late."""

from __future__ import annotations

from typing import Dict, Set

import numpy as np

from atom_calibration.collect.collector import Setup
from atom_calibration.errors import TransformError
from atom_calibration.modalities.frames import Frame
from atom_calibration.modalities.table import Outlook, ros_modality
from atom_core.geometry import se3


class PointExpectation:
    """Warns once for each sensor that can hardly see the board where it stands at first."""

    def __init__(self, setup: Setup):
        """Start; nothing is known yet."""
        self._setup = setup
        self._outlooks: Dict[str, Outlook] = {}
        # Of sensors whose modality can tell, those that are not judged yet.
        self._open: Set[str] = {
            s.name for s in setup.sensors.values() if ros_modality(s.modality).outlook is not None
        }

    def add(self, frame: Frame) -> None:
        """Look at a frame: the first data of a sensor, or where a camera sees the board."""
        name, outlook = frame.sensor.name, frame.ros.outlook
        if name in self._open and name not in self._outlooks and outlook is not None:
            try:
                expected = outlook(frame.data)
            except ValueError as error:
                self._setup.warn(f"{frame.place}: {error}")
                expected = None
            if expected is None:
                self._open.discard(name)
            else:
                self._outlooks[name] = expected
        elif frame.ros.board_pose is not None and frame.detections and self._open:
            self._judge(frame)

    def _judge(self, frame: Frame) -> None:
        tree = self._setup.transforms(frame.stamp_s)
        for pattern in self._setup.patterns.values():
            pose = frame.board_pose(pattern)
            if pose is None:
                continue
            centre = se3.apply(pose, pattern.border.centre_in_pattern[None])
            for name in self._open & set(self._outlooks):
                sensor = self._setup.sensors[name]
                try:
                    sensor_T_camera = tree.lookup(sensor.frame, frame.sensor.frame, frame.stamp_s)
                except TransformError:
                    continue
                self._open.discard(name)
                distance = float(np.linalg.norm(se3.apply(sensor_T_camera, centre)))
                shortage = self._outlooks[name].shortage(pattern, distance)
                if shortage:
                    self._setup.warn(f"sensor '{name}': {shortage}")
