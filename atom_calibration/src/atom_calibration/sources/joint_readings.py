"""Where a robot's joints were read to be about a time: in a bag, or while it runs."""

from __future__ import annotations

import threading
from collections import deque
from typing import Any, Collection, Deque, Dict, List, Mapping, Optional, Sequence, Tuple

import rospy
from sensor_msgs.msg import JointState

from atom_calibration.messages.headers import stamp_s
from atom_calibration.sources.bag_reader import BagReader
from atom_calibration.sources.joint_topics import JOINT_STATES, counting, joint_names, positions

Readings = Sequence[Tuple[float, float]]  # stamps [s] and positions [rad or m]
_AROUND_S = 0.25  # of a time, readings tell where a joint was, and whether it stood still
_REMEMBERED = 20_000  # messages: half a minute, and more


class BagJoints:
    """The joints of a bag, by /joint_states and topics of that name in a namespace."""

    def __init__(self, bag: BagReader, joints: Collection[str]):
        """Look which topics tell the joints of a description."""
        named = joint_names(bag) if joints else {}
        states = {topic: names for topic, names in named.items() if topic.endswith(JOINT_STATES)}
        self._bag, self._counting = bag, counting(states, set(joints))
        self._topics = list(self._counting)
        self._lag_s = bag.receipt_lag_s(self._topics, _set_stamp_s) if self._topics else None

    def around(self, time_s: float) -> Mapping[str, Readings]:
        """Return the readings of each joint around a time [s]."""
        if not self._topics:
            return {}
        lag_s = self._lag_s or 0.0
        found: Dict[str, List[Tuple[float, float]]] = {}
        about_s = time_s + lag_s - _AROUND_S, time_s + lag_s + _AROUND_S
        for topic, message, received_s in self._bag.messages(self._topics, *about_s):
            for name, position in positions(message).items():
                if name in self._counting[topic]:
                    found.setdefault(name, []).append((received_s - lag_s, position))
        return found


class LiveJoints:
    """The joints of a running robot, by /joint_states."""

    def __init__(self) -> None:
        """Start to listen."""
        self._lock = threading.Lock()
        self._heard: Deque[Tuple[float, Mapping[str, float]]] = deque(maxlen=_REMEMBERED)
        self._subscriber = rospy.Subscriber(
            JOINT_STATES, JointState, self._note, queue_size=1000, tcp_nodelay=True
        )

    def _note(self, message: Any) -> None:
        at_s = _set_stamp_s(message)
        with self._lock:
            self._heard.append((rospy.get_time() if at_s is None else at_s, positions(message)))

    def around(self, time_s: float) -> Mapping[str, Readings]:
        """Return the readings of each joint around a time [s]."""
        found: Dict[str, List[Tuple[float, float]]] = {}
        with self._lock:
            near = [heard for heard in self._heard if abs(heard[0] - time_s) <= _AROUND_S]
        for at_s, told in near:
            for name, position in told.items():
                found.setdefault(name, []).append((at_s, position))
        return found


def _set_stamp_s(message: Any) -> Optional[float]:
    """Return the stamp of a message [s]; None: its publisher sets none."""
    return stamp_s(message) or None
