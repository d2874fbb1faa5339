"""Do the clocks of live sensors agree? Stamps of the first data against the times they came."""

from __future__ import annotations

from typing import Any, Collection, Dict, List, Set

import numpy as np
import rospy

from atom_calibration.collect.stamps import Judged, check_clocks
from atom_calibration.errors import CollectionError
from atom_calibration.messages.headers import stamp_s

_UNSET = 3  # data of a sensor without stamps until it is refused
_TIMED = 10  # data of each sensor that tell its clock
_SAME_SPEED = 0.15  # of clocks; what busy machines take at once differs more among sensors
_NOTEWORTHY_S = 0.3  # busy machines take data from their queues so late
NO_CLOCK = (
    "/use_sim_time is set, and nobody publishes /clock: an earlier launch file may have left it "
    "behind; `rosparam set use_sim_time false`, and start again, or play the recording with --clock"
)
LIVE = Judged(
    "use_receive_time:='{}' (of collect_data.launch)", late_s=_NOTEWORTHY_S, ahead_s=_NOTEWORTHY_S
)


def without_stamps(sensor: str) -> str:
    """Return what is said of live data whose stamps are zero."""
    return (
        f"sensor '{sensor}': its stamps are all zero (header.stamp is not set by the driver), and "
        f"live data find their labels by them; let the driver set them, or record a bag and give "
        f"collect_from_bag --use_receive_time {sensor}"
    )


def is_unstamped(message: Any) -> bool:
    """Tell whether live data have no stamp; at the beginning of a simulation zero is one."""
    return bool(message.header.stamp.is_zero()) and not rospy.Time.now().is_zero()


class LiveClocks:
    """Watches the stamps of the first data of each sensor.

    Attributes:
        warnings: what a user should know of the clocks; empty until all sensors have sent enough.
    """

    def __init__(self, sensors: Collection[str], received: Collection[str]):
        """Begin.

        Args:
            sensors: whose data are expected.
            received: sensors whose stamps are not used.
        """
        self._lags_s: Dict[str, List[float]] = {name: [] for name in sensors}
        self._stamps_s: Dict[str, List[float]] = {}  # of those whose stamps are used
        self._unset: Dict[str, int] = dict.fromkeys(sensors, 0)
        self._without_clock: Dict[str, int] = dict.fromkeys(sensors, 0)
        self._received = received
        self._told: Set[str] = set()
        self._apart_s = 0.0
        self._judged = False
        self.warnings: List[str] = []

    def note(self, message: Any, sensor: str) -> None:
        """Take in data that have come now."""
        if len(self._lags_s[sensor]) >= _TIMED:
            return
        now = rospy.Time.now()
        if is_unstamped(message):
            self._unset[sensor] += 1
        elif now.is_zero():
            self._without_clock[sensor] += 1
        else:
            lag_s = 0.0 if sensor in self._received else now.to_sec() - stamp_s(message)
            self._lags_s[sensor].append(lag_s)
            if sensor not in self._received:
                self._stamps_s.setdefault(sensor, []).append(stamp_s(message))

    def check(self) -> List[str]:
        """Return what is to be told of the clocks, once, as soon as enough data have come.

        Raises:
            CollectionError: a driver sets no stamps.
        """
        for sensor, unset in self._unset.items():
            if unset >= _UNSET and not self._lags_s[sensor]:
                raise CollectionError(without_stamps(sensor))
        if NO_CLOCK not in self._told and min(self._without_clock.values(), default=0) >= _TIMED:
            self._told.add(NO_CLOCK)
            return [NO_CLOCK]
        if self._judged or min(map(len, self._lags_s.values()), default=0) < _TIMED:
            return []
        self._judged = True
        speed = self._speed()
        if abs(speed - 1.0) > _SAME_SPEED:
            self.warnings = [
                f"the stamps of all sensors go at {speed:.2f} of the speed of ROS's clock, as of a "
                f"recording that is played faster or slower without /clock, so that nothing tells "
                f"whether the sensors' clocks agree: use `rosbag play --clock`, with /use_sim_time"
            ]
            return self.warnings
        lags_s = {name: float(np.median(lags)) for name, lags in self._lags_s.items()}
        self._apart_s = max(lags_s.values()) - min(lags_s.values())
        try:
            self.warnings = check_clocks(lags_s, None, self._received, LIVE)
        except CollectionError as error:
            self.warnings = [str(error)]
        return self.warnings

    def _speed(self) -> float:
        """Return at which speed of ROS's clock the stamps go; 1 where sensors do not agree."""
        speeds = []
        for sensor, stamps_s in self._stamps_s.items():
            stamped_s = stamps_s[-1] - stamps_s[0]
            passed_s = stamped_s + self._lags_s[sensor][-1] - self._lags_s[sensor][0]
            speeds.append(stamped_s / passed_s if min(stamped_s, passed_s) > 0.0 else np.nan)
        speed = float(np.median(speeds)) if speeds else 1.0
        return speed if np.all(np.abs(np.array(speeds) / speed - 1.0) < _SAME_SPEED) else 1.0

    def why_behind(self, behind_s: float) -> str:
        """Return what makes data come so much later than others [s], with the remedy."""
        if self.warnings and self._apart_s > 0.5 * behind_s:
            return "; ".join(self.warnings)
        return "this machine is too slow: lower the labelers' rate"
