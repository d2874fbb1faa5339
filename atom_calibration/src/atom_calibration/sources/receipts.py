"""When live data came, to be taken instead of the stamps of sensors whose clock is wrong.

Data and their labels are paired by the stamp that both carry, whatever it says; only then the time
of receipt takes its place.
"""

from __future__ import annotations

import copy
from collections import OrderedDict
from typing import Any, Collection, Tuple

import rospy

from atom_calibration.messages.headers import stamp_s

_KEPT = 600  # messages whose times of receipt are remembered; far more than wait for labels


class ReceiptTimes:
    """Times of receipt of the data of some sensors, by their stamps.

    Attributes:
        sensors: names of those whose stamps are not used.
    """

    def __init__(self, sensors: Collection[str]):
        """Take note for these sensors only."""
        self.sensors = tuple(sensors)
        self._came: OrderedDict[Tuple[str, float], rospy.Time] = OrderedDict()

    def __contains__(self, sensor: object) -> bool:
        """Tell whether a sensor's stamps are not used."""
        return sensor in self.sensors

    def note(self, message: Any, sensor: str) -> None:
        """Remember that a message has come now."""
        if sensor in self:
            self._came.setdefault((sensor, stamp_s(message)), rospy.Time.now())
            while len(self._came) > _KEPT:
                self._came.popitem(last=False)

    def time_s(self, message: Any, sensor: str) -> float:
        """Return the time [s] of data, or of labels with their stamp."""
        stamp = stamp_s(message)
        came = self._came.get((sensor, stamp))
        return stamp if came is None else float(came.to_sec())

    def stamped(self, message: Any, sensor: str) -> Any:
        """Return the message with the time of receipt for its stamp; it is left as it was."""
        came = self._came.get((sensor, stamp_s(message)))
        if came is None:
            return message
        changed = copy.copy(message)
        changed.header = copy.copy(message.header)
        changed.header.stamp = came
        return changed
